// The values of a field, block after block: a row of `width` numbers for each value of its graph.
#pragma once

#include <cstddef>
#include <memory>

#include "meshreel/layers.h"

namespace meshreel {

constexpr size_t kRowBlock = 64;  // rows, few enough for the nearest cache while they are worked on (guess)

// A field as coded. The row of value v is row[t] = means[t] + the sum over k, in order, of vectors[k][t] *
// decoded[k][v], where decoded[k][v] = prediction + step * symbols[k][v]; then before[v] is added, where there is such
// an array.
struct Field {
    mr_graph graph;
    size_t columns, width;
    size_t pitch;           // numbers from a vector to the next
    const double* vectors;  // columns, width numbers each
    const double* means;
    const int32_t* symbols;  // column after column
    double step;
    const double* before;  // or null
};

// The field's arrays must outlive it. Its constructor may throw std::bad_alloc.
class FieldRows {
public:
    explicit FieldRows(const Field& field);

    // Writes the rows of the next `count` values; the first call starts with the first value.
    void next(size_t count, double* rows);

private:
    void follow(size_t count, double* rows);
    void predict(size_t begin, size_t end);

    Field field_;
    size_t stride_;  // of a row of `decoded_`: the columns, and zeros up to a whole number of lanes
    std::unique_ptr<double[]> decoded_;
    size_t at_ = 0;
};

}  // namespace meshreel
