#include "field_rows.h"

#include <algorithm>
#include <cstring>

#include "wide.h"

namespace meshreel {
namespace {

// Numbers side by side: compilers turn loops over an array of four into worse code.
#if defined(__GNUC__)
typedef double Register __attribute__((vector_size(32)));
#else
typedef double Register;
#endif
constexpr size_t kRegister = sizeof(Register) / sizeof(double);

void add(const double* __restrict more, double weight, size_t count, double* __restrict sums) {
    for (size_t c = 0; c < count; ++c) sums[c] += weight * more[c];
}

// Numbers t, t + 1 ... of a row that fill a register: their sums stay in it over all columns.
void transform_register(const double* row, const Field& field, size_t t, double* out) {
    Register sum, term;
    std::memcpy(&sum, field.means + t, sizeof sum);
    const double* vector = field.vectors + t;
    for (size_t k = 0; k < field.columns; ++k, vector += field.pitch) {
        std::memcpy(&term, vector, sizeof term);
        sum += row[k] * term;
    }
    std::memcpy(out + t, &sum, sizeof sum);
}

// The same of two registers: the sums of one are made while those of the other are waited for.
void transform_two(const double* row, const Field& field, size_t t, double* out) {
    Register sum, next, term;
    std::memcpy(&sum, field.means + t, sizeof sum);
    std::memcpy(&next, field.means + t + kRegister, sizeof next);
    const double* vector = field.vectors + t;
    for (size_t k = 0; k < field.columns; ++k, vector += field.pitch) {
        std::memcpy(&term, vector, sizeof term);
        sum += row[k] * term;
        std::memcpy(&term, vector + kRegister, sizeof term);
        next += row[k] * term;
    }
    std::memcpy(out + t, &sum, sizeof sum);
    std::memcpy(out + t + kRegister, &next, sizeof next);
}

void transform(const double* row, const Field& field, double* out) {
    const size_t width = field.width;
    size_t t = 0;
    for (; t + 2 * kRegister <= width; t += 2 * kRegister) transform_two(row, field, t, out);
    for (; t + kRegister <= width; t += kRegister) transform_register(row, field, t, out);
    if (t < width && width >= kRegister) return transform_register(row, field, width - kRegister, out);  // some again
    for (; t < width; ++t) {
        double sum = field.means[t];
        for (size_t k = 0; k < field.columns; ++k) sum += row[k] * field.vectors[k * field.pitch + t];
        out[t] = sum;
    }
}

// Prediction of a row, added to it. A sum of none or one needs no beginning at zero: no number of `row` is -0.
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

FieldRows::FieldRows(const Field& field) : field_(field), stride_(stride_of(field.columns)) {}

void FieldRows::next(size_t count, double* rows) {
    wide([&] { follow(count, rows); });
}

void FieldRows::follow(size_t count, double* rows) {
    for (const size_t last = at_ + count; at_ < last;) {
        const size_t end = std::min(at_ + kRowBlock, last);
        predict(at_, end);
        for (; at_ < end; ++at_, rows += field_.width) {
            transform(field_.differences + at_ * stride_, field_, rows);
            if (!field_.before) continue;
            const double from = field_.before[at_];
            for (size_t t = 0; t < field_.width; ++t) rows[t] += from;
        }
    }
}

void FieldRows::predict(size_t begin, size_t end) {
    const mr_graph& graph = field_.graph;
    double* rows = field_.differences;
    double* sums = rows + graph.count * stride_;  // a row of its own behind the others
    for (size_t v = begin; v < end; ++v) add_prediction(graph, v, stride_, rows, sums, rows + v * stride_);
}

}  // namespace meshreel
