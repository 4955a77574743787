#include "field_rows.h"

#include <algorithm>

#include "wide.h"

namespace meshreel {
namespace {

constexpr size_t kLanes = 2;  // columns side by side, each summed as if it were alone

void add(const double* __restrict more, double weight, size_t count, double* __restrict sums) {
    for (size_t c = 0; c < count; ++c) sums[c] += weight * more[c];
}

// sums[t] and four terms weights[k] * v[k][t] in a pass over memory, added one after the other.
void add_four(const double* __restrict v, const double* __restrict weights, size_t width, double* __restrict sums) {
    const double w0 = weights[0], w1 = weights[1], w2 = weights[2], w3 = weights[3];
    for (size_t t = 0; t < width; ++t)
        sums[t] = (((sums[t] + w0 * v[t]) + w1 * v[width + t]) + w2 * v[2 * width + t]) + w3 * v[3 * width + t];
}

void transform(const double* row, const Field& field, double* out) {
    std::copy(field.means, field.means + field.width, out);
    size_t k = 0;
    for (; k + 4 <= field.columns; k += 4) add_four(field.vectors + k * field.width, row + k, field.width, out);
    for (; k < field.columns; ++k) add(field.vectors + k * field.width, row[k], field.width, out);
}

// What predicts a row, added to it. A sum of none or one needs no beginning at zero: no number of `row` is -0.
void add_prediction(const mr_graph& graph, size_t v, size_t stride, const double* rows, double* __restrict sums,
                    double* __restrict row) {
    const int64_t begin = graph.starts[v], count = graph.starts[v + 1] - begin;
    const double* weights = graph.weights + begin;
    const auto near = [&](int64_t k) { return rows + static_cast<size_t>(graph.near[begin + k]) * stride; };
    if (count == 0) return;
    const double *a = near(0), *b = near(count > 1 ? 1 : 0);
    const double w0 = weights[0], w1 = count > 1 ? weights[1] : 0.0;
    if (count == 1) {
        for (size_t c = 0; c < stride; ++c) row[c] += w0 * a[c];
        return;
    }
    if (count == 2) {
        for (size_t c = 0; c < stride; ++c) row[c] += w0 * a[c] + w1 * b[c];
        return;
    }
    for (size_t c = 0; c < stride; ++c) sums[c] = w0 * a[c] + w1 * b[c];
    for (int64_t k = 2; k < count; ++k) add(near(k), weights[k], stride, sums);
    for (size_t c = 0; c < stride; ++c) row[c] += sums[c];
}

}  // namespace

FieldRows::FieldRows(const Field& field)
    : field_(field),
      stride_((field.columns + kLanes - 1) / kLanes * kLanes),
      decoded_(new double[(field.graph.count + 1) * stride_]) {}

void FieldRows::next(size_t count, double* rows) {
    wide([&] { follow(count, rows); });
}

void FieldRows::follow(size_t count, double* rows) {
    for (const size_t last = at_ + count; at_ < last;) {
        const size_t end = std::min(at_ + kRowBlock, last);
        predict(at_, end);
        for (; at_ < end; ++at_, rows += field_.width) {
            transform(decoded_.get() + at_ * stride_, field_, rows);
            if (!field_.before) continue;
            const double from = field_.before[at_];
            for (size_t t = 0; t < field_.width; ++t) rows[t] += from;
        }
    }
}

void FieldRows::predict(size_t begin, size_t end) {
    const mr_graph& graph = field_.graph;
    double* decoded = decoded_.get();
    for (size_t c = 0; c < stride_; ++c)
        for (size_t v = begin; v < end; ++v)
            decoded[v * stride_ + c] =
                c < field_.columns ? field_.step * static_cast<double>(field_.symbols[c * graph.count + v]) : 0.0;
    double* sums = decoded + graph.count * stride_;  // a row of its own behind the others
    for (size_t v = begin; v < end; ++v) add_prediction(graph, v, stride_, decoded, sums, decoded + v * stride_);
}

}  // namespace meshreel
