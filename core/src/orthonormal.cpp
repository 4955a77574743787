#include <cmath>
#include <cstdint>
#include <vector>

#include "guarded.h"
#include "meshreel/layers.h"

namespace meshreel {
namespace {

// v reflected at the plane normal to u, from coordinate `first` on; uu is the square of u's length.
void reflect(const double* u, double uu, size_t first, size_t width, double* v) {
    double sum = 0.0;
    for (size_t i = first; i < width; ++i) sum += u[i] * v[i];
    const double factor = 2.0 * sum / uu;
    for (size_t i = first; i < width; ++i) v[i] -= factor * u[i];
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_orthonormal_inverse(const int32_t* symbols, size_t count, size_t width, double* vectors) {
    if (count > width || width > INT32_MAX) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<double> mirrors(count * width, 0.0), squares(count, 0.0);
        for (size_t k = 0; k < count; symbols += width - k, ++k) {
            double* v = vectors + k * width;
            double* u = mirrors.data() + k * width;
            double square = 0.0;
            for (size_t i = 0; i < width; ++i) v[i] = i < k ? 0.0 : static_cast<double>(symbols[i - k]);
            for (size_t i = k; i < width; ++i) square += v[i] * v[i];
            if (!(square > 0.0)) return MR_NO_DIRECTION;
            const double length = std::sqrt(square);
            for (size_t i = k; i < width; ++i) u[i] = v[i] = v[i] / length;
            u[k] += u[k] < 0.0 ? -1.0 : 1.0;
            for (size_t i = k; i < width; ++i) squares[k] += u[i] * u[i];
            for (size_t j = k; j-- > 0;) reflect(mirrors.data() + j * width, squares[j], j, width, v);
        }
        return MR_OK;
    });
}
