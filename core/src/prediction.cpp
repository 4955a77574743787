#include <algorithm>
#include <cmath>

#include "meshreel/layers.h"
#include "prediction.h"

namespace {

using meshreel::lowered, meshreel::magnitude_around, meshreel::predicted, meshreel::slope;

bool is_causal(const mr_graph& graph) {
    if (graph.starts[0] != 0) return false;
    for (size_t v = 0; v < graph.count; ++v) {
        if (graph.starts[v] > graph.starts[v + 1]) return false;
        for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k)
            if (graph.near[k] < 0 || static_cast<size_t>(graph.near[k]) >= v) return false;
    }
    return true;
}

// So many columns side by side: each is summed as if it were alone.
template <size_t kColumns>
void inverse(const mr_graph& graph, const int32_t* symbols, double step, double* decoded) {
    const size_t count = graph.count;
    for (size_t v = 0; v < count; ++v) {
        double sums[kColumns] = {};
        for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k) {
            const double* value = decoded + graph.near[k];
            for (size_t c = 0; c < kColumns; ++c) sums[c] += graph.weights[k] * value[c * count];
        }
        for (size_t c = 0; c < kColumns; ++c) decoded[c * count + v] = sums[c] + step * static_cast<double>(symbols[c * count + v]);
    }
}

// One column; `mean` is what magnitudes are expected to be, and becomes what they are. False where a symbol has no room.
bool forward(const mr_graph& graph, const double* values, double step, double price, double& mean, int32_t* symbols, double* decoded) {
    double total = 0.0;
    for (size_t v = 0; v < graph.count; ++v) {
        const double guess = predicted(graph, v, decoded);
        const double wanted = (values[v] - guess) / step;
        const double threshold = price > 0.0 ? price * slope(magnitude_around(graph, v, symbols, mean)) : 0.0;
        const double size = lowered(std::fabs(wanted), threshold);
        if (!(size <= 2147483647.0)) return false;
        symbols[v] = static_cast<int32_t>(wanted < 0.0 ? -size : size);
        decoded[v] = guess + step * static_cast<double>(symbols[v]);
        total += size;
    }
    mean = graph.count > 0 ? total / static_cast<double>(graph.count) : 0.0;
    return true;
}

}  // namespace

int mr_predict_inverse(const mr_graph* graph, const int32_t* symbols, size_t columns, double step, double* decoded) {
    if (!is_causal(*graph)) return MR_LAYERS_BAD_INPUT;
    const size_t count = graph->count;
    size_t c = 0;
    for (; c + 4 <= columns; c += 4) inverse<4>(*graph, symbols + c * count, step, decoded + c * count);
    for (; c < columns; ++c) inverse<1>(*graph, symbols + c * count, step, decoded + c * count);
    return MR_LAYERS_OK;
}

int mr_predict_forward(const mr_graph* graph, const double* values, size_t columns, double step, double price, int32_t* symbols,
                       double* decoded) {
    if (!is_causal(*graph)) return MR_LAYERS_BAD_INPUT;
    for (size_t c = 0; c < columns; ++c, values += graph->count, symbols += graph->count, decoded += graph->count) {
        double mean = 1.0;
        if (!forward(*graph, values, step, 0.0, mean, symbols, decoded)) return MR_LAYERS_OVERFLOW;
        for (int pass = 0; pass < 2 && price > 0.0; ++pass)
            if (!forward(*graph, values, step, price, mean, symbols, decoded)) return MR_LAYERS_OVERFLOW;
    }
    return MR_LAYERS_OK;
}

void mr_transform_inverse(const double* columns, size_t count, size_t width, const double* vectors, size_t frames, const double* means,
                          double* out) {
    for (size_t t = 0; t < frames; ++t, out += width) {
        const auto factor = [&](size_t k) { return vectors[k * frames + t]; };
        std::fill(out, out + width, means ? means[t] : 0.0);
        size_t k = 0;
        for (; k + 4 <= count; k += 4) {  // four terms a pass over memory, added one after the other
            const double f0 = factor(k), f1 = factor(k + 1), f2 = factor(k + 2), f3 = factor(k + 3);
            const double *c0 = columns + k * width, *c1 = c0 + width, *c2 = c1 + width, *c3 = c2 + width;
            for (size_t v = 0; v < width; ++v) out[v] = (((out[v] + f0 * c0[v]) + f1 * c1[v]) + f2 * c2[v]) + f3 * c3[v];
        }
        for (; k < count; ++k) {
            const double f = factor(k);
            const double* column = columns + k * width;
            for (size_t v = 0; v < width; ++v) out[v] += f * column[v];
        }
    }
}
