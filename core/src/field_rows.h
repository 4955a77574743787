// The values of a field, block after block: a row of `width` numbers for each value of its graph.
#pragma once

#include <cstddef>

#include "meshreel/layers.h"

namespace meshreel {

constexpr size_t kRowBlock = 64;  // rows, few enough for the nearest cache while they are worked on (guess)

constexpr size_t kLanes = 2;  // columns side by side, each summed as if it were alone

// Numbers from a row of columns to the next: the columns, and zeros up to a whole number of lanes.
constexpr size_t stride_of(size_t columns) { return (columns + kLanes - 1) / kLanes * kLanes; }

// A field as coded. The row of value v is row[t] = means[t] + the sum over k, in order, of vectors[k][t] *
// decoded[k][v], where decoded[k][v] = prediction + differences[k][v]; then before[v] is added, where there is such an
// array.
struct Field {
    mr_graph graph;
    size_t columns, width;
    size_t pitch;           // numbers from a vector to the next
    const double* vectors;  // columns, width numbers each
    const double* means;
    double* differences;   // in rows of stride_of(columns), and room for one more; they become what is decoded
    const double* before;  // or null
};

// The field's arrays must outlive it, and serve one only.
class FieldRows {
public:
    explicit FieldRows(const Field& field);

    // Writes the rows of the next `count` values; the first call starts with the first value.
    void next(size_t count, double* rows);

private:
    void follow(size_t count, double* rows);
    void predict(size_t begin, size_t end);

    Field field_;
    size_t stride_;
    size_t at_ = 0;
};

}  // namespace meshreel
