// A Laplacian system, and the two sparse factors that it may need.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "factor.h"
#include "grounded_solver.h"
#include "sparse_rows.h"

struct mr_laplacian {
    int64_t vertices = 0;
    meshreel::SparseRows rows;  // -L off the diagonal; the diagonal is 1
    std::vector<int32_t> anchors;
    double anchor_weight = 1.0;
    std::unique_ptr<meshreel::GroundedSolver> solver;  // of (L*)^T L*
    std::unique_ptr<meshreel::Factor> normal;          // the same, where components have many anchors
    std::unique_ptr<meshreel::Factor> shaping;         // L* (L*)^T, regularised
};

namespace meshreel {

// For `solve_normal`, once; false where a component has no anchor.
bool factor_normal(mr_laplacian& system);
// x <- ((L*)^T L*)^-1 x in place.
void solve_normal(const mr_laplacian& system, std::vector<double>& x, int64_t columns);
bool factor_shaping(mr_laplacian& system);
void shape(const Factor& factor, const double* deltas, int64_t columns, const double* steps, const double* prices,
           int32_t* symbols);

}  // namespace meshreel
