// The least-squares inverse of L* by a factor of L itself, not of its square: a quarter of the arithmetic.
//
// L has a row of weights that sum to -1 beside each 1 of its diagonal, so it maps constants of a connected component to
// 0. B = L + g g^T, with g the unit vector of one anchor of each component, maps nothing to 0, and B 1 = g. It is an
// M-matrix: B = M U exists without pivoting. The normal equations are those of B and a few terms more,
//     (L*)^T L* = B^T B + F C F^T,   F = [e_a, B^T g],   a over the anchors,
// whose inverse follows from that of B^T B by Woodbury's identity, component by component.
#pragma once

#include <cstdint>
#include <vector>

#include "factor.h"
#include "sparse_rows.h"

namespace meshreel {

// B = M U in an order of little fill, both by the pattern of a symmetric elimination.
class GroundedFactor {
public:
    // Chooses the order of elimination, by the pattern alone. False where it fills in as no surface does.
    bool order(const SparseRows& rows);

    // `grounds`: ascending vertices, one in each component that has edges. False where a pivot vanishes.
    bool compute(const SparseRows& rows, const std::vector<int32_t>& grounds);

    // In place: x <- (B^T B)^-1 x, all columns side by side; x is in the order of vertices.
    void solve(std::vector<double>& x, int64_t columns) const;

private:
    struct Entry {  // at (row, k) of M and (k, row) of U, row > k
        double lower, upper;
    };

    bool count_fill(const SparseRows& rows);
    bool eliminate(const SparseRows& rows, const std::vector<int32_t>& grounds);

    std::vector<int32_t> order_;     // order_[k] is the vertex eliminated k-th
    std::vector<int32_t> position_;  // the inverse
    std::vector<int32_t> parent_;    // elimination tree; -1: a root
    std::vector<int64_t> starts_;
    std::vector<int32_t> rows_;  // ascending in each column
    std::vector<Entry> entries_;
    std::vector<double> pivots_;  // diagonal of U
};

class GroundedSolver {
public:
    enum class Outcome { kReady, kSingular, kTooManyAnchors };

    // Fails where a component has no anchor, or more than pay: then a factor of the square is cheaper.
    Outcome compute(const SparseRows& rows, const std::vector<int32_t>& anchors, double anchor_weight);

    // x <- ((L*)^T L*)^-1 x in place, all columns side by side.
    void solve(std::vector<double>& x, int64_t columns) const;

private:
    struct Component {
        int32_t ground = -1;  // -1: a vertex without edges
        std::vector<int32_t> anchors;
        Factor capacitance;  // C^-1 + F^T (B^T B)^-1 F, its last term eliminated
    };

    void label(const SparseRows& rows);
    bool factor_capacitance(Component& component) const;
    std::vector<double> correction(const Component& component, const double* x, int64_t columns) const;

    const SparseRows* rows_ = nullptr;
    double anchor_weight_ = 1.0;
    GroundedFactor factor_;
    std::vector<int32_t> component_of_;
    std::vector<Component> components_;
    int64_t most_anchors_ = 0;  // of a component
    std::vector<double>
        responses_;  // V x most_anchors_: (B^T B)^-1 e_a, the k-th anchors of all components in column k
};

}  // namespace meshreel
