// The values of a field, block after block: a row of `basis.width` numbers for each value of its graph.
#pragma once

#include <cstddef>
#include <memory>

#include "meshreel/layers.h"

namespace meshreel {

constexpr size_t kRowBlock = 64;  // rows, which the nearest cache holds while they are worked on

// The field's arrays must outlive it. Its constructor may throw std::bad_alloc.
class FieldRows {
public:
    explicit FieldRows(const mr_field& field);

    // The rows of the next values, `count` of them, from the first on.
    void next(size_t count, double* rows);

private:
    void follow(size_t count, double* rows);
    void predict(size_t begin, size_t end);

    mr_field field_;
    size_t stride_;  // of a row of `decoded_`: the columns, and zeros up to a whole number of lanes
    std::unique_ptr<double[]> decoded_;
    size_t at_ = 0;
};

}  // namespace meshreel
