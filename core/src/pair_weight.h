// Weights of pairs of points that are matched.
#pragma once

#include <cmath>

#include "rigid3.h"
#include "strict_exp.h"

namespace meshreel {

inline double length(Vec a) { return std::sqrt(dot(a, a)); }

inline Vec unit(Vec a) {
    const double size = length(a);
    return (1.0 / (size > 0.0 ? size : 1.0)) * a;
}

// Gaussian of a distance in gates, sigma half a gate; 0 past the gate and where normals disagree.
inline double pair_weight(double distance, double agree, double least) {
    return agree > least && distance < 1.0 ? strict_exp(-2.0 * distance * distance) : 0.0;
}

}  // namespace meshreel
