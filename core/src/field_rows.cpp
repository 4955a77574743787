#include <algorithm>
#include <new>
#include <vector>

#include "meshreel/layers.h"
#include "prediction.h"

namespace {

constexpr size_t kLanes = 2;   // columns side by side, each summed as if it were alone
constexpr size_t kBlock = 64;  // of vertices, so that a block of rows stays in the nearest cache

void add(const double* __restrict more, double weight, size_t count, double* __restrict sums) {
    for (size_t c = 0; c < count; ++c) sums[c] += weight * more[c];
}

// decoded[v][c], rows of `stride` columns, of which those beyond `columns` are zero.
void predict(const mr_graph& graph, const int32_t* symbols, size_t columns, double step, size_t stride, double* decoded) {
    std::vector<double> sums(stride);
    for (size_t begin = 0; begin < graph.count; begin += kBlock) {
        const size_t end = std::min(begin + kBlock, graph.count);
        for (size_t c = 0; c < columns; ++c)
            for (size_t v = begin; v < end; ++v) decoded[v * stride + c] = step * static_cast<double>(symbols[c * graph.count + v]);
        for (size_t v = begin; v < end; ++v) {
            std::fill(sums.begin(), sums.end(), 0.0);
            for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k)
                add(decoded + static_cast<size_t>(graph.near[k]) * stride, graph.weights[k], stride, sums.data());
            add(sums.data(), 1.0, stride, decoded + v * stride);
        }
    }
}

// Four terms a pass over memory, added one after the other.
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

}  // namespace

int mr_field_inverse(const mr_graph* graph, const int32_t* symbols, double step, const mr_basis* basis, double* rows) {
    if (!meshreel::is_causal(*graph)) return MR_LAYERS_BAD_INPUT;
    const size_t stride = (basis->columns + kLanes - 1) / kLanes * kLanes;
    try {
        std::vector<double> decoded(graph->count * stride, 0.0);
        predict(*graph, symbols, basis->columns, step, stride, decoded.data());
        for (size_t v = 0; v < graph->count; ++v) transform(decoded.data() + v * stride, *basis, rows + v * basis->width);
    } catch (const std::bad_alloc&) {
        return MR_LAYERS_NO_MEMORY;
    }
    return MR_LAYERS_OK;
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
