#include "field_rows.h"

#include <algorithm>

#include "causal.h"
#include "guarded.h"
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

void transform(const double* row, const mr_basis& basis, double* out) {
    if (basis.means) std::copy(basis.means, basis.means + basis.width, out);
    else std::fill(out, out + basis.width, 0.0);
    size_t k = 0;
    for (; k + 4 <= basis.columns; k += 4) add_four(basis.vectors + k * basis.width, row + k, basis.width, out);
    for (; k < basis.columns; ++k) add(basis.vectors + k * basis.width, row[k], basis.width, out);
}

// What predicts a row, added to it. A sum of none or one needs no beginning at zero: no number of `row` is -0.
void add_prediction(const mr_graph& graph, size_t v, size_t stride, const double* rows, double* __restrict sums, double* __restrict row) {
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

FieldRows::FieldRows(const mr_field& field)
    : field_(field), stride_((field.basis.columns + kLanes - 1) / kLanes * kLanes), decoded_(new double[(field.graph.count + 1) * stride_]) {}

void FieldRows::next(size_t count, double* rows) {
    wide([&] { follow(count, rows); });
}

void FieldRows::follow(size_t count, double* rows) {
    const mr_basis& basis = field_.basis;
    for (const size_t last = at_ + count; at_ < last;) {
        const size_t end = std::min(at_ + kRowBlock, last);
        predict(at_, end);
        for (; at_ < end; ++at_, rows += basis.width) {
            transform(decoded_.get() + at_ * stride_, basis, rows);
            if (!field_.before) continue;
            const double from = field_.before[at_];
            for (size_t t = 0; t < basis.width; ++t) rows[t] += from;
        }
    }
}

void FieldRows::predict(size_t begin, size_t end) {
    const mr_graph& graph = field_.graph;
    double* decoded = decoded_.get();
    for (size_t c = 0; c < stride_; ++c)
        for (size_t v = begin; v < end; ++v)
            decoded[v * stride_ + c] = c < field_.basis.columns ? field_.step * static_cast<double>(field_.symbols[c * graph.count + v]) : 0.0;
    double* sums = decoded + graph.count * stride_;  // a row of its own behind the others
    for (size_t v = begin; v < end; ++v) add_prediction(graph, v, stride_, decoded, sums, decoded + v * stride_);
}

}  // namespace meshreel

int mr_field_inverse(const mr_field* field, double* rows) {
    if (!meshreel::is_causal(field->graph)) return MR_LAYERS_BAD_INPUT;
    return meshreel::guarded(MR_LAYERS_NO_MEMORY, [&] {
        meshreel::FieldRows(*field).next(field->graph.count, rows);
        return int{MR_LAYERS_OK};
    });
}

int mr_place_rows(const double* moved, const int32_t* order, const double* base, size_t vertices, size_t frames, double* rows) {
    double waste = 0.0;  // of numbers that are not finite: anything else times 0 is 0
    for (size_t p = 0; p < vertices; ++p, moved += 3 * frames) {
        const size_t v = static_cast<size_t>(order[p]);
        for (size_t k = 0; k < 3; ++k) {
            double* out = rows + (3 * v + k) * frames;
            const double from = base[3 * v + k];
            for (size_t t = 0; t < frames; ++t) out[t] = moved[3 * t + k] + from, waste += out[t] * 0.0;
        }
    }
    return waste == 0.0;
}

void mr_sibling_weights(const int64_t* starts, size_t edge_count, int weight, double* weights) {
    for (size_t e = 0; e < edge_count; ++e) {
        const double count = static_cast<double>(starts[e + 1] - starts[e]);
        if (count > 0.0) std::fill(weights + starts[e], weights + starts[e + 1], weight / (64.0 * count));
    }
}
