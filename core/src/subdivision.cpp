#include <algorithm>
#include <cmath>
#include <functional>
#include <new>
#include <vector>

#include "meshreel/layers.h"

namespace {

bool in_range(const int32_t* indices, size_t count, size_t vertices) {
    for (size_t k = 0; k < count; ++k)
        if (indices[k] < 0 || static_cast<size_t>(indices[k]) >= vertices) return false;
    return true;
}

// Sorts by insertion what is as short as nearly always.
template <class Iterator, class Less>
void sort_few(Iterator begin, Iterator end, Less less) {
    if (end - begin > 16) return std::sort(begin, end, less);
    for (Iterator next = begin; next != end; ++next) {
        const auto value = *next;
        Iterator at = next;
        for (; at != begin && less(value, *(at - 1)); --at) *at = *(at - 1);
        *at = value;
    }
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
        sort_few(begin, end, [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });
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

// Rows of places or normals: all frames' x of a vertex, then their y, then their z. A loop over frames is one over
// neighbours in memory, and each frame's numbers come about as if it were alone.
struct Rows {
    const double* data;
    size_t frames;
    const double* of(int32_t v) const { return data + 3 * frames * static_cast<size_t>(v); }
};

void face_normal(const Rows& p, const int32_t* face, double* __restrict n) {
    const size_t frames = p.frames;
    const double *a = p.of(face[0]), *b = p.of(face[1]), *c = p.of(face[2]);
    for (size_t t = 0; t < frames; ++t) {
        const size_t ty = t + frames, tz = ty + frames;
        const double ux = b[t] - a[t], uy = b[ty] - a[ty], uz = b[tz] - a[tz];
        const double wx = c[t] - a[t], wy = c[ty] - a[ty], wz = c[tz] - a[tz];
        n[t] = uy * wz - uz * wy, n[ty] = uz * wx - ux * wz, n[tz] = ux * wy - uy * wx;
    }
}

void add(const double* __restrict more, size_t count, double* __restrict sum) {
    for (size_t k = 0; k < count; ++k) sum[k] += more[k];
}

void normalize(size_t frames, double* __restrict n) {
    for (size_t t = 0; t < frames; ++t) {
        double &x = n[t], &y = n[t + frames], &z = n[t + 2 * frames];
        const double length = std::sqrt(x * x + y * y + z * z);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        x *= scale, y *= scale, z *= scale;
    }
}

std::vector<double> normals_of(const Rows& p, size_t vertices, const int32_t* faces, size_t face_count) {
    const size_t width = 3 * p.frames;
    std::vector<double> n(width * vertices, 0.0), one(width);
    for (size_t f = 0; f < face_count; ++f) {
        face_normal(p, faces + 3 * f, one.data());
        for (size_t k = 0; k < 3; ++k) add(one.data(), width, n.data() + width * static_cast<size_t>(faces[3 * f + k]));
    }
    for (size_t v = 0; v < vertices; ++v) normalize(p.frames, n.data() + width * v);
    return n;
}

// Curved midpoint and direction of an edge: on a circle through both ends with their normals, the arc's middle is
// (n_b - n_a) . (b - a) / 8 above the chord's, for small angles.
// Calls visit(frame, place in a row, number of the midpoint, number of the direction).
template <class Visit>
void edge_frame(const Rows& p, const Rows& normals, const int32_t* edge, double share, Visit visit) {
    const size_t frames = p.frames;
    const double *a = p.of(edge[0]), *b = p.of(edge[1]), *m = normals.of(edge[0]), *n = normals.of(edge[1]);
    for (size_t t = 0; t < frames; ++t) {
        const size_t ty = t + frames, tz = ty + frames;
        const double ex = b[t] - a[t], ey = b[ty] - a[ty], ez = b[tz] - a[tz];
        const double bend = ((n[t] - m[t]) * ex + (n[ty] - m[ty]) * ey + (n[tz] - m[tz]) * ez) / 8.0;
        const double most = kMostBend * std::sqrt(ex * ex + ey * ey + ez * ez);
        const double above = bend < -most ? -most : bend;
        const double lift = share * (bend > most ? most : above);
        const double x = m[t] + n[t], y = m[ty] + n[ty], z = m[tz] + n[tz];
        const double length = std::sqrt(x * x + y * y + z * z);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        const double dx = x * scale, dy = y * scale, dz = z * scale;
        visit(t, t, (a[t] + b[t]) / 2.0 + lift * dx, dx);
        visit(t, ty, (a[ty] + b[ty]) / 2.0 + lift * dy, dy);
        visit(t, tz, (a[tz] + b[tz]) / 2.0 + lift * dz, dz);
    }
}

// Places new vertices by the rows of the coarser level's.
struct Refinement {
    Rows places;
    std::vector<double> normals;
    double share;

    Refinement(const Rows& rows, size_t vertices, const int32_t* faces, size_t face_count, int curvature)
        : places(rows), normals(normals_of(rows, vertices, faces, face_count)), share(curvature / 64.0) {}

    void place(const int32_t* edges, size_t edge_count, const double* scalars, double* out) const {
        const size_t frames = places.frames;
        for (size_t e = 0; e < edge_count; ++e, out += 3 * frames, scalars += frames) {
            double* __restrict place = out;
            const double* __restrict scalar = scalars;
            edge_frame(places, {normals.data(), frames}, edges + 2 * e, share,
                       [=](size_t t, size_t k, double middle, double direction) { place[k] = middle + scalar[t] * direction; });
        }
    }
};

constexpr size_t kBlock = 64;  // rows, which the nearest cache holds while they become frames

// Rows written as frames x vertices x 3.
class Frames {
public:
    Frames(double* positions, size_t frames, size_t vertices) : positions_(positions), frames_(frames), vertices_(vertices) {}

    void set(size_t first, const double* rows, size_t count) {
        for (size_t begin = 0; begin < count; begin += kBlock)
            for (size_t t = 0; t < frames_; ++t)
                set_frame(positions_ + 3 * (t * vertices_ + first + begin), rows + 3 * frames_ * begin + t, std::min(kBlock, count - begin));
    }
    bool are_finite() const { return waste_ == 0.0; }

private:
    void set_frame(double* __restrict out, const double* __restrict in, size_t count) {
        double wastes[3] = {};  // of numbers that are not finite: anything else times 0 is 0
        for (size_t v = 0; v < count; ++v, in += 3 * frames_, out += 3) {
            const double x = in[0], y = in[frames_], z = in[2 * frames_];
            out[0] = x, out[1] = y, out[2] = z;
            wastes[0] += x * 0.0, wastes[1] += y * 0.0, wastes[2] += z * 0.0;
        }
        waste_ += wastes[0] + wastes[1] + wastes[2];
    }

    double* positions_;
    size_t frames_, vertices_;
    double waste_ = 0.0;
};

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
            sort_few(begin, end, std::less<>());
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
        const Rows places{positions, 1};
        const std::vector<double> n = normals_of(places, vertices, faces, face_count);
        for (size_t e = 0; e < edge_count; ++e)
            edge_frame(places, {n.data(), 1}, edges + 2 * e, curvature / 64.0, [=](size_t, size_t k, double middle, double direction) {
                midpoints[3 * e + k] = middle;
                directions[3 * e + k] = direction;
            });
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_refine(double* rows, size_t frames, size_t vertices, const int32_t* faces, size_t face_count, const int32_t* edges,
              size_t edge_count, const double* scalars, int curvature) {
    if (!fits(vertices, faces, face_count, edges, edge_count)) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        const Refinement refinement({rows, frames}, vertices, faces, face_count, curvature);
        refinement.place(edges, edge_count, scalars, rows + 3 * frames * vertices);
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_refine_frames(const double* rows, size_t frames, size_t vertices, const int32_t* faces, size_t face_count, const int32_t* edges,
                     size_t edge_count, const double* scalars, int curvature, double* positions, int* finite) {
    if (!fits(vertices, faces, face_count, edges, edge_count)) return MR_LAYERS_BAD_INPUT;
    return guarded([&] {
        const Refinement refinement({rows, frames}, vertices, faces, face_count, curvature);
        const size_t width = 3 * frames;
        std::vector<double> some(width * kBlock);
        Frames out(positions, frames, vertices + edge_count);
        out.set(0, rows, vertices);
        for (size_t e = 0; e < edge_count; e += kBlock) {
            const size_t count = std::min(kBlock, edge_count - e);
            refinement.place(edges + 2 * e, count, scalars + e * frames, some.data());
            out.set(vertices + e, some.data(), count);
        }
        *finite = out.are_finite();
        return static_cast<int>(MR_LAYERS_OK);
    });
}

int mr_frames_of_rows(const double* rows, size_t frames, size_t vertices, double* positions) {
    Frames out(positions, frames, vertices);
    out.set(0, rows, vertices);
    return out.are_finite();
}
