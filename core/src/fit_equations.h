// The linear equations of a round of a fit: 3 x 3 blocks of vertices and edges, and their solution.
#pragma once

#include <array>
#include <vector>

#include "template.h"

namespace meshreel {

// w (n . (sum_k c_k x_k) - value) = 0 on the corners of a face.
struct Row {
    int32_t face;
    std::array<double, 3> corners;
    Vec normal;
    double value, weight;  // the weight is squared
};

class Equations {
public:
    explicit Equations(const Template& fitted) : fitted_(fitted) {}

    // Forgets all rows; steps are counted from these positions.
    void clear(const double* positions);
    void add(const Row& row);

    // Adds the least-squares step that also keeps the shape and the place to `positions`.
    void solve(double smoothing, const std::vector<Vec>& shape, double anchor, const double* place, int iterations,
               double tolerance, double* positions);

private:
    using Numbers = std::vector<float>;  // four a vertex, of which the last is 0

    void precondition(float squared, float anchored);
    void multiply(const Numbers& x, float squared, float anchored, Numbers& out);

    const Template& fitted_;
    const double* at_ = nullptr;
    std::vector<std::array<float, 6>> vertices_, edges_;  // xx xy xz yy yz zz, of n n^T
    std::vector<Vec> right_;
    Numbers inverses_;  // three columns of four a vertex
    Numbers columns_, edge_columns_, left_, pulled_;
};

}  // namespace meshreel
