#include "sparse_rows.h"

namespace meshreel {

void append_transposed(const SparseRows& rows, Eigen::SparseMatrix<double>& matrix) {
    const Eigen::Index n = static_cast<Eigen::Index>(rows.starts.size()) - 1;
    for (Eigen::Index i = 0; i < n; ++i) {
        matrix.startVec(i);
        bool placed = false;  // the diagonal
        for (int64_t p = rows.starts[i]; p < rows.starts[i + 1]; ++p) {
            if (!placed && rows.columns[p] > i) matrix.insertBack(i, i) = 1.0, placed = true;
            matrix.insertBack(rows.columns[p], i) = -rows.values[p];
        }
        if (!placed) matrix.insertBack(i, i) = 1.0;
    }
}

}  // namespace meshreel
