// Exp-Golomb escape of magnitudes that have outgrown their unary models.
#pragma once

#include <cstddef>
#include <cstdint>

#include "range_coder.h"

namespace meshreel {

constexpr int kUnary = 20;  // magnitudes below have a model a step; above, an Exp-Golomb escape

// Exp-Golomb with adaptive exponent and leading mantissa bits, for values 0 .. 2^32 - 2.
struct EscapeModels {
    Model exponent[32];
    Model mantissa[32][4];
};

template <class Coder>
uint64_t code_escape(Coder& coder, EscapeModels& models, uint64_t value) {
    int length = 0;
    while (length < 32 && coder.bit(models.exponent[length < 31 ? length : 31], (value + 1) >> (length + 1) != 0))
        ++length;
    uint64_t read = 1;
    for (int k = length - 1; k >= 0; --k) {
        const bool bit = (value + 1) >> k & 1;
        const bool leading = k >= length - 2;
        const uint64_t node = k == length - 1 ? 1 : 2 + (read & 1);
        const bool coded = leading ? coder.bit(models.mantissa[length - 1][node], bit) : coder.raw_bit(bit);
        read = read << 1 | static_cast<uint64_t>(coded);
    }
    return read - 1;
}

inline bool fits(int64_t value) { return value >= INT32_MIN && value <= INT32_MAX; }

// A coded bit costs at least -log2(65520 / 65536) = 1 / 2840 bit, which bounds the number of symbols in a stream.
inline bool is_plausible(uint64_t count, size_t size) { return count / 22800 <= size + 3; }

}  // namespace meshreel
