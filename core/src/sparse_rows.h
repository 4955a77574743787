#ifndef MESHREEL_SPARSE_ROWS_H
#define MESHREEL_SPARSE_ROWS_H

#include <cstdint>
#include <vector>

struct SparseRows {  // compressed rows, columns ascending
    std::vector<int64_t> starts;
    std::vector<int32_t> columns;
    std::vector<double> values;
};

#endif
