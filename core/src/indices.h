// Indices from outside.
#pragma once

#include <cstddef>
#include <cstdint>

namespace meshreel {

inline bool in_range(const int32_t* indices, size_t count, size_t bound) {
    for (size_t k = 0; k < count; ++k)
        if (indices[k] < 0 || static_cast<size_t>(indices[k]) >= bound) return false;
    return true;
}

}  // namespace meshreel
