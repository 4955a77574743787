#include <algorithm>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include "grounded_solver.h"

namespace meshreel {
namespace {

// Products of an elimination: some, and more for each vertex. A grid of V vertices takes 36 V^1.5 (measured), which is
// a ninth of this at 30,000; surfaces with a handle for each ten vertices, which a file may have, take V^3.
constexpr int64_t kFreeProducts = int64_t{1} << 28, kProductsPerVertex = int64_t{1} << 15;

// The order in which little fills in, by the pattern alone.
void order_of(const SparseRows& rows, std::vector<int32_t>& order, std::vector<int32_t>& position) {
    const Eigen::Index n = static_cast<Eigen::Index>(rows.starts.size()) - 1;
    Eigen::SparseMatrix<double> pattern(n, n);
    pattern.reserve(static_cast<Eigen::Index>(rows.columns.size()) + n);
    append_transposed(rows, pattern);
    pattern.finalize();
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> found;
    Eigen::AMDOrdering<int> amd;
    amd(pattern.selfadjointView<Eigen::Lower>(), found);
    order.resize(n), position.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) order[k] = found.indices()[k];
    for (Eigen::Index k = 0; k < n; ++k) position[order[k]] = static_cast<int32_t>(k);
}

}  // namespace

bool GroundedFactor::order(const SparseRows& rows) {
    order_of(rows, order_, position_);
    return count_fill(rows);
}

bool GroundedFactor::compute(const SparseRows& rows, const std::vector<int32_t>& grounds) {
    rows_.resize(static_cast<size_t>(starts_.back()));
    entries_.resize(static_cast<size_t>(starts_.back()));
    return eliminate(rows, grounds);
}

// The elimination tree, and where each column of M begins: row k has an entry at all that lie between its neighbours
// and k in the tree.
bool GroundedFactor::count_fill(const SparseRows& rows) {
    const int32_t n = static_cast<int32_t>(order_.size());
    std::vector<int32_t> seen(n, -1);
    std::vector<int64_t> counts(n, 0);
    parent_.assign(n, -1);
    int64_t products = 0;  // the sum of the squares of the counts
    const int64_t most = kFreeProducts + kProductsPerVertex * n;
    for (int32_t k = 0; k < n; ++k) {
        if (products > most) return false;  // before it is counted on: that costs as much as there are entries
        seen[k] = k;
        for (int64_t p = rows.starts[order_[k]]; p < rows.starts[order_[k] + 1]; ++p)
            for (int32_t j = position_[rows.columns[p]]; j < k && seen[j] != k; j = parent_[j]) {
                if (parent_[j] < 0) parent_[j] = k;
                products += 2 * counts[j] + 1;
                ++counts[j];
                seen[j] = k;
            }
    }
    starts_.assign(static_cast<size_t>(n) + 1, 0);
    for (int32_t k = 0; k < n; ++k) starts_[k + 1] = starts_[k] + counts[k];
    return products <= most;
}

// Row k of M and column k of U from those before: both have the same pattern, so one pass finds both.
bool GroundedFactor::eliminate(const SparseRows& rows, const std::vector<int32_t>& grounds) {
    const int32_t n = static_cast<int32_t>(order_.size());
    std::vector<int64_t> ends(starts_.begin(), starts_.end() - 1);  // of what columns have so far
    std::vector<Entry> work(n, Entry{0.0, 0.0});                    // row k of B in `lower`, column k in `upper`
    std::vector<int32_t> reach, path, seen(n, -1);
    std::vector<double> diagonal(n, 1.0);
    for (int32_t g : grounds) diagonal[position_[g]] += 1.0;
    const auto value = [&](int32_t i, int32_t j) {  // of row i at column j, which it has
        const auto first = rows.columns.begin() + rows.starts[i], last = rows.columns.begin() + rows.starts[i + 1];
        return -rows.values[std::lower_bound(first, last, j) - rows.columns.begin()];
    };
    pivots_.resize(n);
    for (int32_t k = 0; k < n; ++k) {
        const int32_t vertex = order_[k];
        reach.clear();
        seen[k] = k;
        for (int64_t p = rows.starts[vertex]; p < rows.starts[vertex + 1]; ++p) {
            const int32_t neighbour = position_[rows.columns[p]];
            if (neighbour > k) continue;
            work[neighbour] = {-rows.values[p], value(rows.columns[p], vertex)};
            path.clear();
            for (int32_t j = neighbour; seen[j] != k; j = parent_[j]) path.push_back(j), seen[j] = k;
            reach.insert(reach.end(), path.rbegin(), path.rend());
        }
        double pivot = diagonal[k];
        for (auto r = reach.rbegin(); r != reach.rend(); ++r) {  // children before parents
            const int32_t j = *r;
            const double lower = work[j].lower / pivots_[j], upper = work[j].upper;
            work[j] = {0.0, 0.0};
            for (int64_t p = starts_[j]; p < ends[j]; ++p) {
                Entry& w = work[rows_[p]];
                w.lower -= lower * entries_[p].upper;
                w.upper -= upper * entries_[p].lower;
            }
            pivot -= lower * upper;
            rows_[ends[j]] = k;
            entries_[ends[j]++] = {lower, upper};
        }
        if (!(pivot > kLeastPivot)) return false;
        pivots_[k] = pivot;
    }
    return true;
}

void GroundedFactor::solve(std::vector<double>& x, int64_t columns) const {
    const int32_t n = static_cast<int32_t>(order_.size());
    std::vector<double> y(x.size());
    const auto row = [&](int32_t k) { return y.data() + k * columns; };
    const auto scatter = [&](int32_t k, double Entry::* of) {  // takes row k from those that come after it
        const double* from = row(k);
        for (int64_t p = starts_[k]; p < starts_[k + 1]; ++p) {
            double* to = row(rows_[p]);
            for (int64_t c = 0; c < columns; ++c) to[c] -= entries_[p].*of * from[c];
        }
    };
    const auto gather = [&](int32_t k, double Entry::* of) {  // takes those that come after it from row k
        double* to = row(k);
        for (int64_t p = starts_[k]; p < starts_[k + 1]; ++p) {
            const double* from = row(rows_[p]);
            for (int64_t c = 0; c < columns; ++c) to[c] -= entries_[p].*of * from[c];
        }
    };
    const auto divide = [&](int32_t k) {
        for (int64_t c = 0; c < columns; ++c) row(k)[c] /= pivots_[k];
    };
    for (int32_t k = 0; k < n; ++k) std::copy_n(x.data() + order_[k] * columns, columns, row(k));
    for (int32_t k = 0; k < n; ++k) divide(k), scatter(k, &Entry::upper);  // U^T
    for (int32_t k = n; k-- > 0;) gather(k, &Entry::lower);                // M^T
    for (int32_t k = 0; k < n; ++k) scatter(k, &Entry::lower);             // M
    for (int32_t k = n; k-- > 0;) gather(k, &Entry::upper), divide(k);     // U
    for (int32_t k = 0; k < n; ++k) std::copy_n(row(k), columns, x.data() + order_[k] * columns);
}

}  // namespace meshreel
