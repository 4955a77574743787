// Rounds of a search in which each round finds its pairs again.
#pragma once

#include <cstddef>

namespace meshreel {

// Times the tolerance of the last round, in those before it: the next has other pairs. Shapes of few points, vertices
// of a template or samples that are tracked, are soon solved and may come out exact: not roughly (decision 40;
// guesses).
constexpr double kRougher = 10.0;
constexpr size_t kFew = 2000;

// Relative residual at which the conjugate gradients of a round stop, for so many points.
inline double tolerance_of(size_t round, size_t count, double last, size_t points) {
    return round + 1 < count && points > kFew ? kRougher * last : last;
}

}  // namespace meshreel
