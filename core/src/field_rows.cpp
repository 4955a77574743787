#include <algorithm>
#include <new>
#include <vector>

#include "meshreel/layers.h"
#include "prediction.h"

namespace {

constexpr size_t kLanes = 4;   // columns side by side: each is summed as if it were alone
constexpr size_t kBlock = 64;  // of vertices, so that a block of rows stays in the nearest cache

// decoded[v][c], rows of `stride` columns, of which those beyond `columns` are zero.
void predict(const mr_graph& graph, const int32_t* symbols, size_t columns, double step, size_t stride, double* decoded) {
    for (size_t begin = 0; begin < graph.count; begin += kBlock) {
        const size_t end = std::min(begin + kBlock, graph.count);
        for (size_t c = 0; c < columns; ++c)
            for (size_t v = begin; v < end; ++v) decoded[v * stride + c] = step * static_cast<double>(symbols[c * graph.count + v]);
        for (size_t v = begin; v < end; ++v) {
            double* row = decoded + v * stride;
            for (size_t c = 0; c < stride; c += kLanes) {
                double sums[kLanes] = {};
                for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k) {
                    const double* value = decoded + static_cast<size_t>(graph.near[k]) * stride + c;
                    for (size_t j = 0; j < kLanes; ++j) sums[j] += graph.weights[k] * value[j];
                }
                for (size_t j = 0; j < kLanes; ++j) row[c + j] = sums[j] + row[c + j];
            }
        }
    }
}

// So many numbers of a row side by side.
template <size_t kNumbers>
void transform(const double* row, const mr_basis& basis, size_t t, double* out) {
    double sums[kNumbers];
    for (size_t j = 0; j < kNumbers; ++j) sums[j] = basis.means ? basis.means[t + j] : 0.0;
    const double* vector = basis.vectors + t;
    for (size_t k = 0; k < basis.columns; ++k, vector += basis.width)
        for (size_t j = 0; j < kNumbers; ++j) sums[j] += vector[j] * row[k];
    for (size_t j = 0; j < kNumbers; ++j) out[t + j] = sums[j];
}

}  // namespace

int mr_field_inverse(const mr_graph* graph, const int32_t* symbols, double step, const mr_basis* basis, double* rows) {
    if (!meshreel::is_causal(*graph)) return MR_LAYERS_BAD_INPUT;
    const size_t stride = (basis->columns + kLanes - 1) / kLanes * kLanes;
    try {
        std::vector<double> decoded(graph->count * stride, 0.0);
        predict(*graph, symbols, basis->columns, step, stride, decoded.data());
        for (size_t v = 0; v < graph->count; ++v, rows += basis->width) {
            const double* row = decoded.data() + v * stride;
            size_t t = 0;
            for (; t + 8 <= basis->width; t += 8) transform<8>(row, *basis, t, rows);
            for (; t + 2 <= basis->width; t += 2) transform<2>(row, *basis, t, rows);
            if (t < basis->width) transform<1>(row, *basis, t, rows);
        }
    } catch (const std::bad_alloc&) {
        return MR_LAYERS_NO_MEMORY;
    }
    return MR_LAYERS_OK;
}
