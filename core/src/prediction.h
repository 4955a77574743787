// Common part of both closed-loop quantisers: prediction in a causal graph, and the cost of a magnitude (an encoder's
// estimate).
#pragma once

#include <algorithm>
#include <cmath>

#include "arrays.h"
#include "meshreel/layers.h"

namespace meshreel {

inline double predicted(const mr_graph& graph, size_t v, const double* values) {
    double sum = 0.0;
    for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k) sum += graph.weights[k] * values[graph.near[k]];
    return sum;
}

// The magnitude to expect at v: that of the symbols which predict it, and the mean of its column, twice.
inline double magnitude_around(const mr_graph& graph, size_t v, const int32_t* symbols, double mean) {
    double around = 2.0 * mean, weight = 2.0;
    for (int64_t k = graph.starts[v]; k < graph.starts[v + 1]; ++k, weight += 1.0)
        around += std::fabs(static_cast<double>(symbols[graph.near[k]]));
    return std::max(around / weight, 1e-3);
}

// Bits that a unit of magnitude costs where magnitudes follow a two-sided geometric law of this mean.
inline double slope(double mean) { return -std::log2(mean / (1.0 + std::sqrt(1.0 + mean * mean))); }

// Magnitude of `size` steps: the nearest, or one less where `threshold` squared steps of error more are worth it.
inline double lowered(double size, double threshold) {
    const double nearest = std::floor(size + 0.5);
    if (nearest < 1.0) return 0.0;
    const double above = size - (nearest - 1.0), below = size - nearest;
    return above * above - below * below < threshold ? nearest - 1.0 : nearest;
}

}  // namespace meshreel
