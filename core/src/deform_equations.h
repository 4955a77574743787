// The linear equations of a round of an embedded deformation: rows on nodes of six unknowns, and their solution.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lanes.h"
#include "rigid3.h"

namespace meshreel {

constexpr size_t kTwist = 8;  // floats of a node: turn x y z, step x y z, and two zeros

// Least squares (rows^T rows + prior) x = rows^T miss, by conjugate gradients that multiply with the rows; inverse
// blocks of the nodes are the preconditioner.
class TwistEquations {
public:
    explicit TwistEquations(size_t nodes) : nodes_(nodes), blocks_(nodes), right_(nodes) {}

    void add_prior(size_t node, double turn, double step);

    // `root` (turn . coefficients) = miss on several nodes; those of `node` are `turn` and `step`.
    void begin_row(double miss) { starts_.push_back(columns_.size()), misses_.push_back(miss); }
    void add(int32_t node, Vec turn, Vec step);

    void solve(int iterations, double tolerance, std::vector<float>& x);

private:
    using Numbers = std::vector<float>;

    void invert();
    void multiply(const Numbers& x, Numbers& out) const;

    size_t nodes_;
    std::vector<std::array<double, 36>> blocks_;
    std::vector<std::array<double, 6>> right_;
    std::vector<size_t> starts_;
    std::vector<double> misses_;
    std::vector<int32_t> columns_;
    Numbers values_, prior_, inverses_;
};

}  // namespace meshreel
