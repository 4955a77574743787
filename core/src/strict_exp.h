// e to the power of x by a series, the same on every machine.
#pragma once

#include <cmath>
#include <limits>

namespace meshreel {

inline double strict_exp(double x) {
    if (!(x < 709.782712893384)) return x != x ? x : std::numeric_limits<double>::infinity();
    if (x < -745.2) return 0.0;
    constexpr double kInverse[] = {1.0 / 14, 1.0 / 13, 1.0 / 12, 1.0 / 11, 1.0 / 10, 1.0 / 9, 1.0 / 8,
                                   1.0 / 7,  1.0 / 6,  1.0 / 5,  1.0 / 4,  1.0 / 3,  1.0 / 2, 1.0};
    const double k = std::nearbyint(x * 1.4426950408889634);
    const double r = (x - k * 0.693147180369123816490) - k * 1.90821492927058770002e-10;  // ln 2 in two parts
    double sum = 1.0;
    for (double inverse : kInverse) sum = 1.0 + r * inverse * sum;
    return std::ldexp(sum, static_cast<int>(k));
}

}  // namespace meshreel
