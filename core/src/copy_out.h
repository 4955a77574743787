// Coded bytes on their way out of the C ABI.
#pragma once

#include <cstring>
#include <vector>

#include "meshreel/entropy.h"

namespace meshreel::entropy {

inline int copy_out(const std::vector<uint8_t>& bytes, uint8_t* out, size_t capacity) {
    if (bytes.size() > capacity) return MESHREEL_ENTROPY_OUT_TOO_SMALL;
    if (!bytes.empty()) std::memcpy(out, bytes.data(), bytes.size());
    return MESHREEL_ENTROPY_OK;
}

}  // namespace meshreel::entropy
