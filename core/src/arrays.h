// Arrays that cross the C ABI: indices and graphs are checked on their way in, bytes are copied on their way out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "meshreel/entropy.h"
#include "meshreel/layers.h"

namespace meshreel {

inline bool in_range(const int32_t* indices, size_t count, size_t bound) {
    for (size_t k = 0; k < count; ++k)
        if (indices[k] < 0 || static_cast<size_t>(indices[k]) >= bound) return false;
    return true;
}

// True where near[starts[v] .. starts[v + 1]) are below v for each of `count` values, and no link lies beyond `links`.
inline bool is_causal(size_t count, const int64_t* starts, const int32_t* near, int64_t links) {
    if (starts[0] != 0) return false;
    for (size_t v = 0; v < count; ++v) {
        if (starts[v] > starts[v + 1] || starts[v + 1] > links) return false;
        for (int64_t k = starts[v]; k < starts[v + 1]; ++k)
            if (near[k] < 0 || static_cast<size_t>(near[k]) >= v) return false;
    }
    return true;
}

inline bool is_causal(const mr_graph& graph) {
    return is_causal(graph.count, graph.starts, graph.near, graph.starts[graph.count]);
}

inline bool is_causal(const mr_weights& weights) {
    const int64_t links = static_cast<int64_t>(weights.neighbour_count);
    return weights.starts[weights.count] == links &&
           is_causal(weights.count, weights.starts, weights.neighbours, links);
}

inline int copy_out(const std::vector<uint8_t>& bytes, uint8_t* out, size_t capacity) {
    if (bytes.size() > capacity) return MR_OUT_TOO_SMALL;
    if (!bytes.empty()) std::memcpy(out, bytes.data(), bytes.size());
    return MR_OK;
}

}  // namespace meshreel
