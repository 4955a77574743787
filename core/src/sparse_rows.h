#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/SparseCore>

namespace meshreel {

struct SparseRows {  // compressed rows, columns ascending
    std::vector<int64_t> starts;
    std::vector<int32_t> columns;
    std::vector<double> values;
};

// Appends the rows of 1 - R to those columns of a matrix that come first: (1 - R)^T, 32-bit indices.
void append_transposed(const SparseRows& rows, Eigen::SparseMatrix<double>& matrix);

}  // namespace meshreel
