#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/SparseCore>

namespace meshreel {

constexpr double kLeastPivot = 1e-14;  // a matrix with less is taken for singular

// P A P^T = L D L^T, solved for all right-hand sides side by side.
class Factor {
public:
    bool compute(const Eigen::SparseMatrix<double>& lower);
    // `out` may be `right`.
    void solve(const double* right, int64_t columns, double* out) const;

    std::vector<int32_t> order;   // order[k] is the unknown eliminated k-th
    std::vector<int32_t> starts;  // L by columns, unit diagonal left out
    std::vector<int32_t> rows;
    std::vector<double> values;
    std::vector<double> pivots;  // D
};

}  // namespace meshreel
