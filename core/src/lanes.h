// Four floats side by side. Compilers that know vectors take one instruction for all, others a loop: the same bits.
#pragma once

#include <cstring>

namespace meshreel {

#if defined(__GNUC__)
using Lanes = float __attribute__((vector_size(16)));

inline Lanes larger(Lanes a, Lanes b) { return a > b ? a : b; }
inline Lanes smaller(Lanes a, Lanes b) { return a < b ? a : b; }
#else
struct Lanes {
    float v[4];
    float& operator[](int k) { return v[k]; }
    float operator[](int k) const { return v[k]; }
};

template <class Combine>
Lanes each(const Lanes& a, const Lanes& b, Combine combine) {
    Lanes out;
    for (int k = 0; k < 4; ++k) out.v[k] = combine(a.v[k], b.v[k]);
    return out;
}

inline Lanes operator+(Lanes a, Lanes b) {
    return each(a, b, [](float x, float y) { return x + y; });
}
inline Lanes operator-(Lanes a, Lanes b) {
    return each(a, b, [](float x, float y) { return x - y; });
}
inline Lanes operator*(Lanes a, Lanes b) {
    return each(a, b, [](float x, float y) { return x * y; });
}
inline Lanes larger(Lanes a, Lanes b) {
    return each(a, b, [](float x, float y) { return x > y ? x : y; });
}
inline Lanes smaller(Lanes a, Lanes b) {
    return each(a, b, [](float x, float y) { return x < y ? x : y; });
}
#endif

inline Lanes lanes(float x) { return Lanes{x, x, x, x}; }

inline Lanes load_lanes(const float* from) {
    Lanes out;
    std::memcpy(&out, from, sizeof out);
    return out;
}

inline void store_lanes(float* to, Lanes a) { std::memcpy(to, &a, sizeof a); }

}  // namespace meshreel
