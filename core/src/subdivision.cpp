#include <algorithm>
#include <cmath>
#include <new>
#include <vector>

#include "meshreel/layers.h"

namespace {

bool in_range(const int32_t* indices, size_t count, size_t vertices) {
    for (size_t k = 0; k < count; ++k)
        if (indices[k] < 0 || static_cast<size_t>(indices[k]) >= vertices) return false;
    return true;
}

// Half-edges grouped by their smaller end, in each group by their larger; equal ones are one edge.
struct HalfEdge {
    int32_t high;
    int32_t slot;  // 3 * face + side
};

size_t number_edges(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* numbers) {
    std::vector<size_t> starts(vertices + 1, 0);
    const auto ends = [&](size_t slot) {
        const int32_t a = faces[slot], b = faces[slot % 3 == 2 ? slot - 2 : slot + 1];
        return std::pair<int32_t, int32_t>(std::min(a, b), std::max(a, b));
    };
    for (size_t slot = 0; slot < 3 * face_count; ++slot) ++starts[static_cast<size_t>(ends(slot).first) + 1];
    for (size_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
    std::vector<HalfEdge> halves(3 * face_count);
    std::vector<size_t> next(starts.begin(), starts.end() - 1);
    for (size_t slot = 0; slot < 3 * face_count; ++slot) {
        const auto [low, high] = ends(slot);
        halves[next[static_cast<size_t>(low)]++] = {high, static_cast<int32_t>(slot)};
    }
    size_t count = 0;
    for (size_t v = 0; v < vertices; ++v) {
        const auto begin = halves.begin() + static_cast<int64_t>(starts[v]), end = halves.begin() + static_cast<int64_t>(starts[v + 1]);
        std::sort(begin, end, [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });
        for (auto half = begin; half != end; ++half) {
            if (half == begin || half->high != (half - 1)->high) {
                edges[2 * count] = static_cast<int32_t>(v);
                edges[2 * count + 1] = half->high;
                ++count;
            }
            numbers[half->slot] = static_cast<int32_t>(count - 1);
        }
    }
    return count;
}

constexpr double kMostBend = 0.15;  // of an edge's length

void normals_of(const double* p, size_t vertices, const int32_t* faces, size_t face_count, std::vector<double>& n) {
    n.assign(3 * vertices, 0.0);
    for (size_t f = 0; f < face_count; ++f) {
        const int32_t* face = faces + 3 * f;
        const double* a = p + 3 * static_cast<size_t>(face[0]);
        const double* b = p + 3 * static_cast<size_t>(face[1]);
        const double* c = p + 3 * static_cast<size_t>(face[2]);
        const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
        const double wx = c[0] - a[0], wy = c[1] - a[1], wz = c[2] - a[2];
        const double x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx;
        for (int k = 0; k < 3; ++k) {
            double* sum = n.data() + 3 * static_cast<size_t>(face[k]);
            sum[0] += x, sum[1] += y, sum[2] += z;
        }
    }
    for (size_t v = 0; v < vertices; ++v) {
        double* x = n.data() + 3 * v;
        const double length = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        x[0] *= scale, x[1] *= scale, x[2] *= scale;
    }
}

// Calls visit(edge, curved midpoint, direction): on a circle through both ends with their normals, the arc's middle is
// (n_b - n_a) . (b - a) / 8 above the chord's, for small angles.
template <class Visit>
void for_each_edge(const double* p, const std::vector<double>& n, const int32_t* edges, size_t edge_count, int curvature,
                   Visit visit) {
    const double share = curvature / 64.0;
    for (size_t e = 0; e < edge_count; ++e) {
        const size_t a = 3 * static_cast<size_t>(edges[2 * e]), b = 3 * static_cast<size_t>(edges[2 * e + 1]);
        const double ex = p[b] - p[a], ey = p[b + 1] - p[a + 1], ez = p[b + 2] - p[a + 2];
        const double bend = ((n[b] - n[a]) * ex + (n[b + 1] - n[a + 1]) * ey + (n[b + 2] - n[a + 2]) * ez) / 8.0;
        const double most = kMostBend * std::sqrt(ex * ex + ey * ey + ez * ez);
        const double lift = share * (bend > most ? most : bend < -most ? -most : bend);
        const double x = n[a] + n[b], y = n[a + 1] + n[b + 1], z = n[a + 2] + n[b + 2];
        const double length = std::sqrt(x * x + y * y + z * z);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        const double direction[3] = {x * scale, y * scale, z * scale};
        const double middle[3] = {(p[a] + p[b]) / 2.0 + lift * direction[0], (p[a + 1] + p[b + 1]) / 2.0 + lift * direction[1],
                                  (p[a + 2] + p[b + 2]) / 2.0 + lift * direction[2]};
        visit(e, middle, direction);
    }
}

template <class Body>
int guarded(Body body) {
    try {
        return body();
    } catch (const std::bad_alloc&) {
        return MR_LAYERS_NO_MEMORY;
    }
}

bool fits(size_t vertices, const int32_t* faces, size_t face_count, const int32_t* edges, size_t edge_count) {
    return in_range(faces, 3 * face_count, vertices) && in_range(edges, 2 * edge_count, vertices);
}

}  // namespace

int mr_subdivide(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* finer, size_t* edge_count) {
    if (!in_range(faces, 3 * face_count, vertices) || vertices + 3 * face_count > INT32_MAX) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        std::vector<int32_t> numbers(3 * face_count);
        *edge_count = number_edges(faces, face_count, vertices, edges, numbers.data());
        const int32_t first = static_cast<int32_t>(vertices);
        for (size_t f = 0; f < face_count; ++f, finer += 12) {
            const int32_t a = faces[3 * f], b = faces[3 * f + 1], c = faces[3 * f + 2];
            const int32_t ab = first + numbers[3 * f], bc = first + numbers[3 * f + 1], ca = first + numbers[3 * f + 2];
            const int32_t cut[12] = {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca};
            std::copy(cut, cut + 12, finer);
        }
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_siblings(const int32_t* finer, size_t face_count, size_t vertices, size_t edge_count, int64_t* starts, int32_t* near) {
    const int64_t first = static_cast<int64_t>(vertices);
    const auto in_face = [&](size_t f, int k) { return finer[12 * f + 9 + static_cast<size_t>(k)] - first; };
    for (size_t f = 0; f < face_count; ++f)
        for (int k = 0; k < 3; ++k)
            if (in_face(f, k) < 0 || in_face(f, k) >= static_cast<int64_t>(edge_count)) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        std::vector<int64_t> bounds(edge_count + 1, 0);
        const auto each_pair = [&](auto&& visit) {
            for (size_t f = 0; f < face_count; ++f)
                for (int k = 0; k < 3; ++k)
                    for (int j = 0; j < 3; ++j)
                        if (in_face(f, j) < in_face(f, k)) visit(in_face(f, k), in_face(f, j));
        };
        each_pair([&](int64_t late, int64_t) { ++bounds[static_cast<size_t>(late) + 1]; });
        for (size_t e = 0; e < edge_count; ++e) bounds[e + 1] += bounds[e];
        std::vector<int32_t> all(static_cast<size_t>(bounds[edge_count]));
        std::vector<int64_t> next(bounds.begin(), bounds.end() - 1);
        each_pair([&](int64_t late, int64_t early) { all[static_cast<size_t>(next[static_cast<size_t>(late)]++)] = static_cast<int32_t>(early); });
        starts[0] = 0;
        for (size_t e = 0; e < edge_count; ++e) {
            const auto begin = all.begin() + bounds[e], end = all.begin() + bounds[e + 1];
            std::sort(begin, end);
            const auto last = std::unique(begin, end);
            std::copy(begin, last, near + starts[e]);
            starts[e + 1] = starts[e] + (last - begin);
        }
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_edge_frames(const double* positions, size_t vertices, const int32_t* faces, size_t face_count, const int32_t* edges,
                   size_t edge_count, int curvature, double* midpoints, double* directions) {
    if (!fits(vertices, faces, face_count, edges, edge_count)) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        std::vector<double> normals;
        normals_of(positions, vertices, faces, face_count, normals);
        for_each_edge(positions, normals, edges, edge_count, curvature, [&](size_t e, const double* middle, const double* direction) {
            std::copy(middle, middle + 3, midpoints + 3 * e);
            std::copy(direction, direction + 3, directions + 3 * e);
        });
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_refine(double* positions, size_t vertices, const int32_t* faces, size_t face_count, const int32_t* edges, size_t edge_count,
              const double* scalars, int curvature) {
    if (!fits(vertices, faces, face_count, edges, edge_count)) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        std::vector<double> normals;
        normals_of(positions, vertices, faces, face_count, normals);
        double* out = positions + 3 * vertices;
        for_each_edge(positions, normals, edges, edge_count, curvature, [&](size_t e, const double* middle, const double* direction) {
            for (int k = 0; k < 3; ++k) out[3 * e + static_cast<size_t>(k)] = middle[k] + scalars[e] * direction[k];
        });
        return static_cast<int>(MR_LAYERS_OK);
    });
}
