#include "fit_equations.h"

#include <cmath>

#include "lanes.h"

namespace meshreel {
namespace {

constexpr size_t kWide = 4;  // floats of a vertex

void add_block(std::array<float, 6>& block, float weight, const float* outer) {
    for (int k = 0; k < 6; ++k) block[k] += weight * outer[k];
}

// The columns of a symmetric block, side by side.
void spread_block(const std::array<float, 6>& block, float* columns) {
    const auto& [xx, xy, xz, yy, yz, zz] = block;
    const float all[3 * kWide] = {xx, xy, xz, 0, xy, yy, yz, 0, xz, yz, zz, 0};
    std::copy(all, all + 3 * kWide, columns);
}

Lanes times(const float* columns, const float* x) {
    return load_lanes(columns) * lanes(x[0]) + load_lanes(columns + kWide) * lanes(x[1]) +
           load_lanes(columns + 2 * kWide) * lanes(x[2]);
}

double product(const std::vector<float>& a, const std::vector<float>& b) {
    double sums[kWide] = {};
    for (size_t k = 0; k < a.size(); k += kWide)
        for (size_t d = 0; d < kWide; ++d) sums[d] += static_cast<double>(a[k + d]) * static_cast<double>(b[k + d]);
    return sums[0] + sums[1] + sums[2];
}

// The inverse of a symmetric matrix plus `more` on its diagonal, as columns.
void invert(const std::array<float, 6>& block, double more, float* columns) {
    const double xx = block[0] + more, xy = block[1], xz = block[2], yy = block[3] + more, yz = block[4],
                 zz = block[5] + more;
    const double a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy;
    const double scale = 1.0 / (xx * a + xy * b + xz * c);
    const std::array<float, 6> inverse = {
        static_cast<float>(scale * a),
        static_cast<float>(scale * b),
        static_cast<float>(scale * c),
        static_cast<float>(scale * (xx * zz - xz * xz)),
        static_cast<float>(scale * (xy * xz - xx * yz)),
        static_cast<float>(scale * (xx * yy - xy * xy)),
    };
    spread_block(inverse, columns);
}

}  // namespace

void Equations::clear(const double* positions) {
    at_ = positions;
    vertices_.assign(fitted_.count, {});
    edges_.assign(fitted_.edges.size(), {});
    right_.assign(fitted_.count, Vec{0, 0, 0});
}

void Equations::add(const Row& row) {
    const auto& face = fitted_.faces[static_cast<size_t>(row.face)];
    const auto& of_edges = fitted_.face_edges[static_cast<size_t>(row.face)];
    const Vec n = row.normal;
    double miss = row.value;
    for (int k = 0; k < 3; ++k) miss -= row.corners[k] * dot(n, load(at_ + 3 * static_cast<size_t>(face[k])));
    const double w = row.weight;
    const float outer[6] = {static_cast<float>(w * n.x * n.x), static_cast<float>(w * n.x * n.y),
                            static_cast<float>(w * n.x * n.z), static_cast<float>(w * n.y * n.y),
                            static_cast<float>(w * n.y * n.z), static_cast<float>(w * n.z * n.z)};
    for (int k = 0; k < 3; ++k) {
        const double c = row.corners[k], next = row.corners[(k + 1) % 3];
        const size_t v = static_cast<size_t>(face[k]);
        add_block(vertices_[v], static_cast<float>(c * c), outer);
        add_block(edges_[static_cast<size_t>(of_edges[k])], static_cast<float>(c * next), outer);
        right_[v] = right_[v] + (w * miss * c) * n;
    }
}

void Equations::precondition(float squared, float anchored) {
    inverses_.resize(3 * kWide * fitted_.count);
    columns_.resize(3 * kWide * fitted_.count);
    for (size_t v = 0; v < fitted_.count; ++v) {
        double own = 1.0;  // of L^T L
        for (int32_t k = fitted_.starts[v]; k < fitted_.starts[v + 1]; ++k) {
            const double share = static_cast<double>(fitted_.shares[static_cast<size_t>(fitted_.near[k])]);
            own += share * share;
        }
        invert(vertices_[v], static_cast<double>(squared) * own + static_cast<double>(anchored),
               &inverses_[3 * kWide * v]);
        spread_block(vertices_[v], &columns_[3 * kWide * v]);
    }
    edge_columns_.resize(3 * kWide * edges_.size());
    for (size_t e = 0; e < edges_.size(); ++e) spread_block(edges_[e], &edge_columns_[3 * kWide * e]);
}

// out = (rows + squared L^T L + anchored) x
void Equations::multiply(const Numbers& x, float squared, float anchored, Numbers& out) {
    const Template& f = fitted_;
    const auto ring = [&f](const Numbers& of, size_t v) {
        Lanes sum = lanes(0.0f);
        for (int32_t k = f.starts[v]; k < f.starts[v + 1]; ++k)
            sum = sum + load_lanes(&of[kWide * static_cast<size_t>(f.near[k])]);
        return sum;
    };
    for (size_t v = 0; v < f.count; ++v) {
        const Lanes share = lanes(f.shares[v]), row = load_lanes(&x[kWide * v]) - share * ring(x, v);
        store_lanes(&left_[kWide * v], row);
        store_lanes(&pulled_[kWide * v], share * row);
    }
    for (size_t v = 0; v < f.count; ++v) {
        const float* own = &x[kWide * v];
        const Lanes smooth = lanes(squared) * (load_lanes(&left_[kWide * v]) - ring(pulled_, v));
        store_lanes(&out[kWide * v], smooth + lanes(anchored) * load_lanes(own) + times(&columns_[3 * kWide * v], own));
    }
    for (size_t e = 0; e < edges_.size(); ++e) {
        const size_t a = kWide * static_cast<size_t>(f.edges[e][0]), b = kWide * static_cast<size_t>(f.edges[e][1]);
        const float* columns = &edge_columns_[3 * kWide * e];
        store_lanes(&out[a], load_lanes(&out[a]) + times(columns, &x[b]));
        store_lanes(&out[b], load_lanes(&out[b]) + times(columns, &x[a]));
    }
}

void Equations::solve(double smoothing, const std::vector<Vec>& shape, double anchor, const double* place,
                      int iterations, double tolerance, double* positions) {
    const size_t count = fitted_.count;
    const double squared = smoothing * smoothing, anchored = anchor * anchor;
    std::vector<Vec> off;
    laplacian(fitted_, positions, off);
    for (size_t v = 0; v < count; ++v) off[v] = squared * (shape[v] - off[v]);
    const size_t size = kWide * count;
    Numbers x(size), r(size), z(size), p(size), product_of(size);
    left_.resize(size), pulled_.resize(size);
    for (size_t v = 0; v < count; ++v) {
        Vec back{0, 0, 0};
        for (int32_t k = fitted_.starts[v]; k < fitted_.starts[v + 1]; ++k) {
            const size_t near = static_cast<size_t>(fitted_.near[k]);
            back = back + static_cast<double>(fitted_.shares[near]) * off[near];
        }
        const Vec pull = right_[v] + (off[v] - back) + anchored * (load(place + 3 * v) - load(positions + 3 * v));
        r[kWide * v] = static_cast<float>(pull.x), r[kWide * v + 1] = static_cast<float>(pull.y);
        r[kWide * v + 2] = static_cast<float>(pull.z);
    }
    const float s = static_cast<float>(squared), a = static_cast<float>(anchored);
    precondition(s, a);
    const auto conditioned = [&] {
        for (size_t v = 0; v < count; ++v) store_lanes(&z[kWide * v], times(&inverses_[3 * kWide * v], &r[kWide * v]));
        return product(r, z);
    };
    double rz = conditioned();
    p = z;
    const double enough = tolerance * tolerance * rz;
    for (int k = 0; k < iterations && rz > enough; ++k) {
        multiply(p, s, a, product_of);
        const float step = static_cast<float>(rz / product(p, product_of));
        for (size_t i = 0; i < size; ++i) x[i] += step * p[i], r[i] -= step * product_of[i];
        const double before = rz;
        rz = conditioned();
        const float more = static_cast<float>(rz / before);
        for (size_t i = 0; i < size; ++i) p[i] = z[i] + more * p[i];
    }
    for (size_t v = 0; v < count; ++v)
        for (size_t d = 0; d < 3; ++d) positions[3 * v + d] += static_cast<double>(x[kWide * v + d]);
}

}  // namespace meshreel
