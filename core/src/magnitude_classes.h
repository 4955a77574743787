// Classes of expected magnitude, the contexts of both coders of fields and weights.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace meshreel {

constexpr int kClasses = 15;
constexpr int kClamp = 255;                 // larger magnitudes count as this one
constexpr uint64_t kFirstRatio = 1u << 11;  // a column about as large as the one before

// Lower end of a class, in sixteenths of a step.
constexpr uint32_t kBegin[kClasses - 1] = {1, 5, 9, 14, 20, 28, 40, 64, 100, 160, 300, 600, 1200, 2400};

// The class of `parts` times an expected magnitude, for one that is known as a fraction of `parts` need not be divided.
template <uint32_t parts>
class ClassTable {
public:
    constexpr ClassTable() {
        uint8_t index = 0;
        for (uint32_t e = 0; e <= kLast; ++e) {
            while (index < kClasses - 1 && e >= parts * kBegin[index]) ++index;
            classes_[e] = index;
        }
    }
    template <class Integer>
    constexpr uint8_t operator[](Integer expected) const {
        return classes_[expected < kLast ? expected : kLast];
    }

private:
    static constexpr uint32_t kLast = parts * kBegin[kClasses - 2];
    std::array<uint8_t, kLast + 1> classes_{};
};

}  // namespace meshreel
