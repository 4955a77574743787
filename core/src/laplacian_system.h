// What a Laplacian system holds, and the two sparse factors it may need.
#ifndef MESHREEL_LAPLACIAN_SYSTEM_H
#define MESHREEL_LAPLACIAN_SYSTEM_H

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

struct SparseRows {  // compressed rows, columns ascending
    std::vector<int64_t> starts;
    std::vector<int32_t> columns;
    std::vector<double> values;
};

// P A P^T = L D L^T, solved for all right-hand sides side by side.
class Factor {
  public:
    bool compute(const Eigen::SparseMatrix<double>& lower);
    void solve(const double* right, int64_t columns, double* out) const;

    std::vector<int32_t> order;      // order[k] is the unknown eliminated k-th
    std::vector<int32_t> starts;     // L by columns, unit diagonal left out
    std::vector<int32_t> rows;
    std::vector<double> values;
    std::vector<double> pivots;      // D
};

struct mr_laplacian {
    int64_t vertices = 0;
    SparseRows rows;  // -L off the diagonal; the diagonal is 1
    std::vector<int32_t> anchors;
    double anchor_weight = 1.0;
    std::unique_ptr<Factor> normal;   // (L*)^T L*
    std::unique_ptr<Factor> shaping;  // L* (L*)^T, regularised
};

bool factor_normal(mr_laplacian& system);
bool factor_shaping(mr_laplacian& system);
void shape(const Factor& factor, const double* deltas, int64_t columns, const double* steps, const double* prices,
           int32_t* symbols);

#endif
