#include "template.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace meshreel {
namespace {

constexpr int kSpread = 3;        // averagings over the ring, since a folded ring determines no rotation (guess)
constexpr int kSteps = 50;        // of a rotation, at most; a warm start takes 2 to 4
constexpr double kStill = 1e-12;  // rad^2, of the last of them

using Sums = std::array<double, 9>;

Vec difference(const double* positions, int32_t to, int32_t from) {
    return load(positions + 3 * static_cast<size_t>(to)) - load(positions + 3 * static_cast<size_t>(from));
}

}  // namespace

Template::Template(const int32_t* given, size_t face_count, size_t vertices)
    : count(vertices), faces(face_count), face_edges(face_count), corners(vertices, -1), inside(vertices, 1) {
    struct Corner {
        std::array<int32_t, 2> edge;
        int32_t face, from;
    };
    std::vector<Corner> all;
    all.reserve(3 * face_count);
    for (size_t f = 0; f < face_count; ++f) {
        faces[f] = {given[3 * f], given[3 * f + 1], given[3 * f + 2]};
        for (int k = 0; k < 3; ++k) {
            const int32_t a = faces[f][k], b = faces[f][(k + 1) % 3], face = static_cast<int32_t>(f);
            all.push_back({{std::min(a, b), std::max(a, b)}, face, k});
            if (corners[a] < 0) corners[a] = 3 * face + k;
        }
    }
    std::stable_sort(all.begin(), all.end(), [](const Corner& a, const Corner& b) { return a.edge < b.edge; });
    for (size_t k = 0, next = 0; k < all.size(); k = next) {
        for (next = k; next < all.size() && all[next].edge == all[k].edge; ++next)
            face_edges[static_cast<size_t>(all[next].face)][all[next].from] = static_cast<int32_t>(edges.size());
        edges.push_back(all[k].edge);
        if (next - k > 1) continue;
        sides.push_back({all[k].face, all[k].from});
        inside[all[k].edge[0]] = inside[all[k].edge[1]] = 0;
    }
    std::sort(sides.begin(), sides.end(),
              [](const Side& a, const Side& b) { return a.face != b.face ? a.face < b.face : a.from < b.from; });
    starts.assign(count + 1, 0);
    for (const auto& edge : edges)
        if (edge[0] != edge[1]) ++starts[edge[0] + 1], ++starts[edge[1] + 1];
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    near.resize(static_cast<size_t>(starts[count]));
    std::vector<int32_t> filled(starts.begin(), starts.end() - 1);
    for (const auto& edge : edges)  // first those below each vertex, then those above it: ascending
        if (edge[0] != edge[1]) near[filled[edge[1]]++] = edge[0];
    for (const auto& edge : edges)
        if (edge[0] != edge[1]) near[filled[edge[0]]++] = edge[1];
    shares.resize(count);
    for (size_t v = 0; v < count; ++v)
        shares[v] = starts[v + 1] > starts[v] ? 1.0f / static_cast<float>(starts[v + 1] - starts[v]) : 0.0f;
}

std::unique_ptr<SurfaceTree> Template::take_tree(const double* rest) const {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (rest_.empty()) rest_.assign(rest, rest + 3 * count);
        if (!free_.empty()) {
            std::unique_ptr<SurfaceTree> tree = std::move(free_.back());
            free_.pop_back();
            return tree;
        }
    }
    return std::make_unique<SurfaceTree>(mr_mesh{rest_.data(), count, faces[0].data(), faces.size()});
}

void Template::give_tree(std::unique_ptr<SurfaceTree> tree) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    free_.push_back(std::move(tree));
}

void laplacian(const Template& fitted, const double* positions, std::vector<Vec>& rows) {
    rows.resize(fitted.count);
    for (size_t v = 0; v < fitted.count; ++v) {
        Vec sum{0, 0, 0};
        for (int32_t k = fitted.starts[v]; k < fitted.starts[v + 1]; ++k)
            sum = sum + load(positions + 3 * static_cast<size_t>(fitted.near[k]));
        const int32_t degree = fitted.starts[v + 1] - fitted.starts[v];
        rows[v] = load(positions + 3 * v) - (degree > 0 ? 1.0 / degree : 0.0) * sum;
    }
}

void neighbourhood_turns(const Template& fitted, const double* rest, const double* now, std::vector<Matrix>& turns) {
    std::vector<Sums> sums(fitted.count), others(fitted.count);
    for (size_t v = 0; v < fitted.count; ++v) {
        Matrix outer{};
        double size = 1e-30;
        for (int32_t k = fitted.starts[v]; k < fitted.starts[v + 1]; ++k) {
            const int32_t from = static_cast<int32_t>(v);
            add_outer(outer, difference(now, fitted.near[k], from), difference(rest, fitted.near[k], from));
        }
        for (const Vec& row : outer.row) size += std::fabs(row.x) + std::fabs(row.y) + std::fabs(row.z);
        for (size_t r = 0; r < 3; ++r) store(&sums[v][3 * r], (1.0 / size) * outer.row[r]);
    }
    for (int round = 0; round < kSpread; ++round) {  // half the mean of the ring, half its own
        for (size_t v = 0; v < fitted.count; ++v) {
            Sums mean{};
            for (int32_t k = fitted.starts[v]; k < fitted.starts[v + 1]; ++k)
                for (size_t i = 0; i < 9; ++i) mean[i] += sums[fitted.near[k]][i];
            const double share = 0.5 * static_cast<double>(fitted.shares[v]);
            for (size_t i = 0; i < 9; ++i) others[v][i] = 0.5 * sums[v][i] + share * mean[i];
        }
        sums.swap(others);
    }
    const bool cold = turns.empty();
    if (cold) turns.assign(fitted.count, identity());
    for (size_t v = 0; v < fitted.count; ++v) {
        const int32_t first = fitted.starts[v] < fitted.starts[v + 1] ? fitted.near[fitted.starts[v]] : 0;
        if (cold && first < static_cast<int32_t>(v)) turns[v] = turns[first];  // its neighbour's, which is known
        const Matrix matrix{{load(&sums[v][0]), load(&sums[v][3]), load(&sums[v][6])}};
        follow(turns[v], matrix, kSteps, kStill);
    }
}

}  // namespace meshreel
