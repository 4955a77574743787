#include <algorithm>
#include <cmath>

#include "meshreel/layers.h"
#include "prediction.h"

namespace meshreel {
namespace {

// One column; `mean` is what magnitudes are expected to be, and becomes what they are. False where a symbol has no
// room.
bool forward(const mr_graph& graph, const double* values, double step, double price, double& mean, int32_t* symbols,
             double* decoded) {
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
}  // namespace meshreel

using namespace meshreel;

int mr_predict_forward(const mr_graph* graph, const double* values, size_t columns, double step, double price,
                       int32_t* symbols, double* decoded) {
    if (!is_causal(*graph)) return MR_NOT_CAUSAL;
    for (size_t c = 0; c < columns; ++c, values += graph->count, symbols += graph->count, decoded += graph->count) {
        double mean = 1.0;
        if (!forward(*graph, values, step, 0.0, mean, symbols, decoded)) return MR_OVERFLOW;
        for (int pass = 0; pass < 2 && price > 0.0; ++pass)
            if (!forward(*graph, values, step, price, mean, symbols, decoded)) return MR_OVERFLOW;
    }
    return MR_OK;
}
