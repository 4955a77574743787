// Causal graphs from outside: each value's neighbours come before it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "meshreel/entropy.h"
#include "meshreel/layers.h"

namespace meshreel {

// Whether near[starts[v] .. starts[v + 1]) are below v for all of `count` values, and no link is behind `links`.
inline bool is_causal(size_t count, const int64_t* starts, const int32_t* near, int64_t links) {
    if (starts[0] != 0) return false;
    for (size_t v = 0; v < count; ++v) {
        if (starts[v] > starts[v + 1] || starts[v + 1] > links) return false;
        for (int64_t k = starts[v]; k < starts[v + 1]; ++k)
            if (near[k] < 0 || static_cast<size_t>(near[k]) >= v) return false;
    }
    return true;
}

inline bool is_causal(const mr_graph& graph) { return is_causal(graph.count, graph.starts, graph.near, graph.starts[graph.count]); }

inline bool is_causal(const meshreel_weights& weights) {
    const int64_t links = static_cast<int64_t>(weights.neighbour_count);
    return weights.starts[weights.count] == links && is_causal(weights.count, weights.starts, weights.neighbours, links);
}

}  // namespace meshreel
