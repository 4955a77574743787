#include "laplacian_system.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SparseCore>

#include "meshreel/laplacian.h"

namespace meshreel {

using Sparse = Eigen::SparseMatrix<double>;  // by columns, 32-bit indices

namespace {

constexpr double kLoading = 1e-6;  // added to a diagonal of about 1 (guess)

// (L*)^T by columns: column i is row i of L*, so both Gram matrices are plain sparse products.
Sparse transposed_system(const mr_laplacian& system) {
    const int64_t n = system.vertices, l = static_cast<int64_t>(system.anchors.size());
    Sparse t(n, n + l);
    t.reserve(static_cast<Eigen::Index>(system.rows.columns.size()) + n + l);
    append_transposed(system.rows, t);
    for (int64_t a = 0; a < l; ++a) {
        t.startVec(n + a);
        t.insertBack(system.anchors[a], n + a) = system.anchor_weight;
    }
    t.finalize();
    return t;
}

}  // namespace

bool factor_normal(mr_laplacian& system) {
    if (system.solver || system.normal) return true;
    auto solver = std::make_unique<GroundedSolver>();
    const auto outcome = solver->compute(system.rows, system.anchors, system.anchor_weight);
    if (outcome == GroundedSolver::Outcome::kReady) system.solver = std::move(solver);
    if (outcome != GroundedSolver::Outcome::kTooManyAnchors) return outcome == GroundedSolver::Outcome::kReady;
    const Sparse t = transposed_system(system);
    const Sparse gram = (t * Sparse(t.transpose())).triangularView<Eigen::Lower>();
    auto factor = std::make_unique<Factor>();
    if (!factor->compute(gram)) return false;
    system.normal = std::move(factor);
    return true;
}

void solve_normal(const mr_laplacian& system, std::vector<double>& x, int64_t columns) {
    if (system.solver) return system.solver->solve(x, columns);
    system.normal->solve(x.data(), columns, x.data());
}

// The error that symbols' rounding e leaves in the weights is the least g with L* g = e, of squared length
// e^T (L* L*^T)^-1 e. A small multiple of the identity stands for the few directions that the least squares ignore.
bool factor_shaping(mr_laplacian& system) {
    if (system.shaping) return true;
    const Sparse t = transposed_system(system);
    Sparse gram = (Sparse(t.transpose()) * t).triangularView<Eigen::Lower>();
    for (Eigen::Index k = 0; k < gram.cols(); ++k) gram.coeffRef(k, k) += kLoading;
    auto factor = std::make_unique<Factor>();
    if (!factor->compute(gram)) return false;
    system.shaping = std::move(factor);
    return true;
}

// With P L* L*^T P^T = L D L^T and e = L u the squared error is sum u_k^2 / D_k: it splits into one term a symbol, in
// elimination order, and u_k = e_k - sum_{j<k} L_kj u_j is what rounding k has to make small.
void shape(const Factor& factor, const double* deltas, int64_t columns, const double* steps, const double* prices,
           int32_t* symbols) {
    const int64_t n = static_cast<int64_t>(factor.order.size());
    std::vector<double> debt(static_cast<size_t>(n * columns), 0.0);  // sum_{j<k} L_kj u_j, in steps
    std::vector<double> u(static_cast<size_t>(columns));
    for (int64_t k = 0; k < n; ++k) {
        const int64_t i = factor.order[k];
        const double pivot = factor.pivots[k];
        for (int64_t c = 0; c < columns; ++c) {
            const double wanted = deltas[i * columns + c] / steps[c] + debt[k * columns + c];
            const auto cost = [&](double q) { return (q - wanted) * (q - wanted) + pivot * prices[c] * std::fabs(q); };
            double q = std::floor(wanted + 0.5);
            const double smaller = q > 0.0 ? q - 1.0 : q + 1.0;
            if (q != 0.0 && cost(smaller) < cost(q)) q = smaller;
            q = std::min(std::max(q, -1.0e9), 1.0e9);
            symbols[i * columns + c] = static_cast<int32_t>(q);
            u[c] = q - wanted;
        }
        for (int32_t p = factor.starts[k]; p < factor.starts[k + 1]; ++p) {
            double* to = debt.data() + static_cast<int64_t>(factor.rows[p]) * columns;
            for (int64_t c = 0; c < columns; ++c) to[c] += factor.values[p] * u[c];
        }
    }
}

}  // namespace meshreel
