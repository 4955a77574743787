#include "factor.h"

#include <algorithm>

#include <Eigen/SparseCholesky>

namespace meshreel {

bool Factor::compute(const Eigen::SparseMatrix<double>& lower) {
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::AMDOrdering<int>> ldlt;
    ldlt.compute(lower);
    if (ldlt.info() != Eigen::Success) return false;
    const Eigen::Index n = lower.rows();
    const auto& l = ldlt.matrixL().nestedExpression();
    starts.assign(l.outerIndexPtr(), l.outerIndexPtr() + n + 1);
    rows.assign(l.innerIndexPtr(), l.innerIndexPtr() + l.nonZeros());
    values.assign(l.valuePtr(), l.valuePtr() + l.nonZeros());
    pivots.resize(n);
    order.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
        pivots[k] = ldlt.vectorD()[k];
        if (!(pivots[k] > kLeastPivot)) return false;
        order[ldlt.permutationP().indices()[k]] = static_cast<int32_t>(k);
    }
    return true;
}

void Factor::solve(const double* right, int64_t columns, double* out) const {
    const int64_t n = static_cast<int64_t>(order.size());
    std::vector<double> x(static_cast<size_t>(n * columns));
    for (int64_t k = 0; k < n; ++k) std::copy_n(right + order[k] * columns, columns, x.data() + k * columns);
    for (int64_t k = 0; k < n; ++k) {
        const double* from = x.data() + k * columns;
        for (int32_t p = starts[k]; p < starts[k + 1]; ++p) {
            double* to = x.data() + rows[p] * columns;
            for (int64_t c = 0; c < columns; ++c) to[c] -= values[p] * from[c];
        }
    }
    for (int64_t k = n - 1; k >= 0; --k) {
        double* to = x.data() + k * columns;
        for (int64_t c = 0; c < columns; ++c) to[c] /= pivots[k];
        for (int32_t p = starts[k]; p < starts[k + 1]; ++p) {
            const double* from = x.data() + rows[p] * columns;
            for (int64_t c = 0; c < columns; ++c) to[c] -= values[p] * from[c];
        }
        std::copy_n(to, columns, out + order[k] * columns);
    }
}

}  // namespace meshreel
