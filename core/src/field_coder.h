// The stream of a field's symbols: see mr_encode_field.
#pragma once

#include "meshreel/entropy.h"

namespace meshreel {

// Numbers of a field row after row: for each value those of all columns, and room up to the next row.
struct FieldTable {
    double* numbers;
    size_t stride;
};

// Writes step * symbol into a table of zeros where a symbol is not zero, which few are; false where the stream is not
// that of such symbols. Of `shape` only the graph, which must be causal, and the number of columns count. May throw
// std::bad_alloc.
bool decode_symbols(const mr_weights& shape, const mr_bytes& stream, double step, const FieldTable& table);

}  // namespace meshreel
