#include "meshreel/laplacian.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "guarded.h"
#include "laplacian_system.h"
#include "rigid3.h"

namespace meshreel {
namespace {

// Bounds that keep a degenerate corner from owning its row: tan(a/2) of 2.3 and 170 degrees, edges of a twentieth of
// the mean at their vertex, weights of a fiftieth of the largest in their row.
constexpr double kLeastTangent = 0.02, kMostTangent = 11.0, kLeastEdge = 0.05, kLeastWeight = 0.02;

double half_tangent(Vec u, Vec w) {
    const Vec c = cross(u, w);
    const double below = std::sqrt(dot(u, u)) * std::sqrt(dot(w, w)) + dot(u, w);
    const double above = std::sqrt(dot(c, c));
    if (!(below > 0.0)) return above > 0.0 ? kMostTangent : kLeastTangent;
    return std::min(std::max(above / below, kLeastTangent), kMostTangent);
}

struct Corner {
    int32_t neighbour;
    double tangent;
};

// Every face corner (i; j, k) gives tan(a_i / 2) to the directed edges i -> j and i -> k: grouped by i, in face order.
void collect_corners(const double* positions, int64_t vertices, const int32_t* faces, int64_t face_count,
                     std::vector<int64_t>& starts, std::vector<Corner>& corners) {
    starts.assign(static_cast<size_t>(vertices) + 1, 0);
    const auto usable = [&](const int32_t* f) { return f[0] != f[1] && f[1] != f[2] && f[2] != f[0]; };
    for (int64_t f = 0; f < face_count; ++f)
        if (usable(faces + 3 * f))
            for (int c = 0; c < 3; ++c) starts[faces[3 * f + c] + 1] += 2;
    for (int64_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
    corners.resize(static_cast<size_t>(starts[vertices]));
    std::vector<int64_t> next(starts.begin(), starts.end() - 1);
    for (int64_t f = 0; f < face_count; ++f) {
        if (!usable(faces + 3 * f)) continue;
        for (int c = 0; c < 3; ++c) {
            const int32_t i = faces[3 * f + c], j = faces[3 * f + (c + 1) % 3], k = faces[3 * f + (c + 2) % 3];
            const auto at = [&](int32_t v) { return load(positions + 3 * int64_t{v}); };
            const double tangent = half_tangent(at(j) - at(i), at(k) - at(i));
            corners[next[i]++] = {j, tangent};
            corners[next[i]++] = {k, tangent};
        }
    }
}

// One row of eq. 11 off the diagonal: corners of equal neighbour summed, divided by the edge, bounded, normalised.
void finish_row(const double* positions, int64_t i, Corner* first, Corner* last, SparseRows& rows) {
    std::stable_sort(first, last, [](const Corner& a, const Corner& b) { return a.neighbour < b.neighbour; });
    const size_t begin = rows.columns.size();
    for (Corner* c = first; c != last; ++c) {
        if (rows.columns.size() > begin && rows.columns.back() == c->neighbour) rows.values.back() += c->tangent;
        else rows.columns.push_back(c->neighbour), rows.values.push_back(c->tangent);
    }
    const size_t count = rows.columns.size() - begin;
    if (count == 0) return;
    std::vector<double> lengths(count);
    double mean = 0.0;
    for (size_t k = 0; k < count; ++k) {
        const Vec edge = load(positions + 3 * int64_t{rows.columns[begin + k]}) - load(positions + 3 * i);
        lengths[k] = std::sqrt(dot(edge, edge));
        mean += lengths[k];
    }
    mean /= static_cast<double>(count);
    double largest = 0.0, sum = 0.0;
    for (size_t k = 0; k < count; ++k) {
        double& w = rows.values[begin + k];
        w = mean > 0.0 ? w * mean / std::max(lengths[k], kLeastEdge * mean) : 1.0;
        largest = std::max(largest, w);
    }
    for (size_t k = 0; k < count; ++k) {
        double& w = rows.values[begin + k];
        w = std::max(w, kLeastWeight * largest);
        sum += w;
    }
    for (size_t k = 0; k < count; ++k) rows.values[begin + k] /= sum;
}

bool good_input(const double* positions, int64_t vertices, const int32_t* faces, int64_t face_count,
                const int32_t* anchors, int64_t anchor_count) {
    if (vertices < 0 || face_count < 0 || anchor_count < 0 || vertices + anchor_count > INT32_MAX / 4) return false;
    for (int64_t k = 0; k < 3 * vertices; ++k)
        if (!(std::fabs(positions[k]) <= 1e100)) return false;
    for (int64_t k = 0; k < 3 * face_count; ++k)
        if (faces[k] < 0 || faces[k] >= vertices) return false;
    for (int64_t k = 0; k < anchor_count; ++k)
        if (anchors[k] < (k ? anchors[k - 1] + 1 : 0) || anchors[k] >= vertices) return false;
    return true;
}

// (L*)^T deltas, row by row.
std::vector<double> transposed(const mr_laplacian& system, const double* deltas, int64_t columns) {
    const SparseRows& r = system.rows;
    const int64_t n = system.vertices;
    std::vector<double> product(deltas, deltas + n * columns);
    for (int64_t i = 0; i < n; ++i) {
        const double* y = deltas + i * columns;
        for (int64_t p = r.starts[i]; p < r.starts[i + 1]; ++p) {
            double* x = product.data() + r.columns[p] * columns;
            for (int64_t k = 0; k < columns; ++k) x[k] -= r.values[p] * y[k];
        }
    }
    for (size_t a = 0; a < system.anchors.size(); ++a) {
        double* x = product.data() + system.anchors[a] * columns;
        const double* y = deltas + (n + static_cast<int64_t>(a)) * columns;
        for (int64_t k = 0; k < columns; ++k) x[k] += system.anchor_weight * y[k];
    }
    return product;
}

// Residual of a solver's rounding, solved for and added.
void refine(const mr_laplacian& system, const std::vector<double>& right, int64_t columns, double* weights) {
    std::vector<double> fitted((system.vertices + system.anchors.size()) * columns);
    mr_laplacian_forward(&system, weights, columns, fitted.data());
    std::vector<double> left = transposed(system, fitted.data(), columns);
    for (size_t k = 0; k < left.size(); ++k) left[k] = right[k] - left[k];
    solve_normal(system, left, columns);
    for (size_t k = 0; k < left.size(); ++k) weights[k] += left[k];
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_laplacian_create(const mr_mesh* mesh, const int32_t* anchors, int64_t anchor_count, double anchor_weight,
                        mr_laplacian** out) {
    const double* positions = mesh->positions;
    const int32_t* faces = mesh->faces;
    const int64_t vertices = static_cast<int64_t>(mesh->vertices), face_count = static_cast<int64_t>(mesh->face_count);
    return guarded(MR_NO_MEMORY, MR_BAD_INPUT, [&] {
        if (!good_input(positions, vertices, faces, face_count, anchors, anchor_count)) return int(MR_BAD_INPUT);
        auto system = std::make_unique<mr_laplacian>();
        std::vector<int64_t> starts;
        std::vector<Corner> corners;
        collect_corners(positions, vertices, faces, face_count, starts, corners);
        system->vertices = vertices;
        system->anchors.assign(anchors, anchors + anchor_count);
        system->anchor_weight = anchor_weight;
        SparseRows& rows = system->rows;
        rows.starts.push_back(0);
        for (int64_t i = 0; i < vertices; ++i) {
            finish_row(positions, i, corners.data() + starts[i], corners.data() + starts[i + 1], rows);
            rows.starts.push_back(static_cast<int64_t>(rows.columns.size()));
        }
        *out = system.release();
        return int(MR_OK);
    });
}

void mr_laplacian_destroy(mr_laplacian* system) { delete system; }

int64_t mr_laplacian_weights(const mr_laplacian* system, int32_t* rows, int32_t* columns, double* weights) {
    const SparseRows& r = system->rows;
    if (rows)
        for (int64_t i = 0; i < system->vertices; ++i)
            for (int64_t p = r.starts[i]; p < r.starts[i + 1]; ++p) {
                rows[p] = static_cast<int32_t>(i);
                columns[p] = r.columns[p];
                weights[p] = r.values[p];
            }
    return static_cast<int64_t>(r.columns.size());
}

int mr_laplacian_forward(const mr_laplacian* system, const double* weights, int64_t columns, double* deltas) {
    const SparseRows& r = system->rows;
    const int64_t n = system->vertices;
    for (int64_t i = 0; i < n; ++i) {
        double* y = deltas + i * columns;
        std::copy(weights + i * columns, weights + (i + 1) * columns, y);
        for (int64_t p = r.starts[i]; p < r.starts[i + 1]; ++p) {
            const double* g = weights + r.columns[p] * columns;
            for (int64_t k = 0; k < columns; ++k) y[k] -= r.values[p] * g[k];
        }
    }
    for (size_t a = 0; a < system->anchors.size(); ++a)
        for (int64_t k = 0; k < columns; ++k)
            deltas[(n + static_cast<int64_t>(a)) * columns + k] =
                system->anchor_weight * weights[system->anchors[a] * columns + k];
    return MR_OK;
}

int mr_laplacian_inverse(mr_laplacian* system, const double* deltas, int64_t columns, double* weights) {
    return guarded(MR_NO_MEMORY, MR_BAD_INPUT, [&] {
        if (!factor_normal(*system)) return int(MR_SINGULAR);
        const std::vector<double> right = transposed(*system, deltas, columns);
        std::vector<double> found = right;
        solve_normal(*system, found, columns);
        std::copy(found.begin(), found.end(), weights);
        if (system->solver) refine(*system, right, columns, weights);  // four digits, which the ground costs
        return int(MR_OK);
    });
}

int mr_laplacian_solve(const mr_mesh* mesh, const int32_t* anchors, int64_t anchor_count, double anchor_weight,
                       const double* deltas, int64_t columns, double* weights) {
    mr_laplacian* system = nullptr;
    int status = mr_laplacian_create(mesh, anchors, anchor_count, anchor_weight, &system);
    if (status == MR_OK) status = mr_laplacian_inverse(system, deltas, columns, weights);
    mr_laplacian_destroy(system);
    return status;
}

int mr_laplacian_quantize(mr_laplacian* system, const double* deltas, int64_t columns, const double* steps,
                          const double* prices, int32_t* symbols) {
    return guarded(MR_NO_MEMORY, MR_BAD_INPUT, [&] {
        if (!factor_shaping(*system)) return int(MR_SINGULAR);
        shape(*system->shaping, deltas, columns, steps, prices, symbols);
        return int(MR_OK);
    });
}

void mr_klt_inverse(const double* weights, int64_t rows, int64_t columns, const double* vectors, const double* mean,
                    int64_t width, double* field) {
    for (int64_t i = 0; i < rows; ++i) {
        double* d = field + i * width;
        std::copy(mean, mean + width, d);
        for (int64_t k = 0; k < columns; ++k) {
            const double g = weights[i * columns + k];
            const double* v = vectors + k * width;
            for (int64_t c = 0; c < width; ++c) d[c] += g * v[c];
        }
    }
}
