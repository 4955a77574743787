// Products, inverses, eigenvectors and elementary functions in strict arithmetic.
#include "meshreel/dense.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "guarded.h"
#include "strict_exp.h"

namespace meshreel {
namespace {

constexpr size_t kRows = 256;       // of a product that stays in the cache while all rows of b pass
constexpr size_t kSmall = 1 << 16;  // its numbers
constexpr int kSweeps = 60;         // of Jacobi rotations; 6 to 10 suffice

void product(const double* a, const double* b, size_t rows, size_t inner, size_t columns, double* out) {
    std::fill(out, out + rows * columns, 0.0);
    const auto add = [&](size_t i, size_t k) {
        const double factor = a[i * inner + k];
        const double* row = b + k * columns;
        double* sums = out + i * columns;
        for (size_t j = 0; j < columns; ++j) sums[j] += factor * row[j];
    };
    if (rows <= kRows && rows * columns <= kSmall) {  // both orders add to each sum in the order of `inner`
        for (size_t k = 0; k < inner; ++k)
            for (size_t i = 0; i < rows; ++i) add(i, k);
    } else {
        for (size_t i = 0; i < rows; ++i)
            for (size_t k = 0; k < inner; ++k) add(i, k);
    }
}

// Gauss-Jordan elimination with partial pivoting; `work` is a copy of the matrix.
void invert(std::vector<double>& work, size_t n, double* out) {
    for (size_t i = 0; i < n * n; ++i) out[i] = i % (n + 1) == 0 ? 1.0 : 0.0;
    for (size_t k = 0; k < n; ++k) {
        size_t best = k;
        for (size_t i = k + 1; i < n; ++i)
            if (std::fabs(work[i * n + k]) > std::fabs(work[best * n + k])) best = i;
        for (size_t j = 0; j < n && best != k; ++j) {
            std::swap(work[k * n + j], work[best * n + j]);
            std::swap(out[k * n + j], out[best * n + j]);
        }
        const double pivot = work[k * n + k];
        for (size_t j = 0; j < n; ++j) work[k * n + j] /= pivot, out[k * n + j] /= pivot;
        for (size_t i = 0; i < n; ++i) {
            const double factor = work[i * n + k];
            if (i == k || factor == 0.0) continue;
            for (size_t j = 0; j < n; ++j) {
                work[i * n + j] -= factor * work[k * n + j];
                out[i * n + j] -= factor * out[k * n + j];
            }
        }
    }
}

// A rotation in the plane of rows p and q of both matrices, n numbers a row.
void rotate(double* matrix, size_t n, size_t p, size_t q, double c, double s) {
    for (size_t k = 0; k < n; ++k) {
        const double x = matrix[p * n + k], y = matrix[q * n + k];
        matrix[p * n + k] = c * x - s * y;
        matrix[q * n + k] = s * x + c * y;
    }
}

// Makes a(p, q) zero; the rows of `vectors` turn with it.
void annihilate(double* a, double* vectors, size_t n, size_t p, size_t q) {
    const double half = (a[q * n + q] - a[p * n + p]) / (2.0 * a[p * n + q]);
    const double t = (half < 0.0 ? -1.0 : 1.0) / (std::fabs(half) + std::sqrt(half * half + 1.0));
    const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
    const double shift = t * a[p * n + q], pp = a[p * n + p] - shift, qq = a[q * n + q] + shift;
    rotate(a, n, p, q, c, s);
    for (size_t k = 0; k < n; ++k) a[k * n + p] = a[p * n + k], a[k * n + q] = a[q * n + k];
    a[p * n + p] = pp, a[q * n + q] = qq, a[p * n + q] = a[q * n + p] = 0.0;
    rotate(vectors, n, p, q, c, s);
}

// Cyclic Jacobi rotations until no number beside the diagonal counts against the two on it.
void diagonalise(double* a, double* vectors, size_t n) {
    for (size_t i = 0; i < n * n; ++i) vectors[i] = i % (n + 1) == 0 ? 1.0 : 0.0;
    double size = 0.0;
    for (size_t i = 0; i < n * n; ++i) size = std::max(size, std::fabs(a[i]));
    const double least = size * std::numeric_limits<double>::epsilon() / 4;
    bool turned = std::isfinite(size);
    for (int sweep = 0; turned && sweep < kSweeps; ++sweep) {
        turned = false;
        for (size_t p = 0; p + 1 < n; ++p)
            for (size_t q = p + 1; q < n; ++q) {
                if (!(std::fabs(a[p * n + q]) > least)) continue;
                annihilate(a, vectors, n, p, q);
                turned = true;
            }
    }
}

double log2_of(double x) {
    if (!(x > 0.0)) {
        return x == 0.0 ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    }
    if (!std::isfinite(x)) return x;
    int exponent = 0;
    double m = std::frexp(x, &exponent);
    if (m < 0.70710678118654752) m *= 2.0, exponent -= 1;
    const double s = (m - 1.0) / (m + 1.0), square = s * s;
    double sum = 0.0;
    for (double n = 23.0; n >= 1.0; n -= 2.0) sum = 1.0 / n + square * sum;
    return exponent + 2.0 * s * sum / 0.69314718055994530942;
}

double angle_of(double y, double x) {
    if (std::max(x, y) == 0.0) return 0.0;
    const bool steep = y > x;
    double t = steep ? x / y : y / x;
    t /= 1.0 + std::sqrt(1.0 + t * t);  // the tangent of half the angle, twice
    t /= 1.0 + std::sqrt(1.0 + t * t);
    const double square = t * t;
    double sum = 0.0;
    for (double n = 27.0; n >= 1.0; n -= 2.0) sum = 1.0 / n - square * sum;
    const double angle = 4.0 * (t * sum);
    return steep ? 1.5707963267948966 - angle : angle;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

void mr_products(const double* a, const double* b, size_t count, size_t rows, size_t inner, size_t columns,
                 double* out) {
    for (size_t n = 0; n < count; ++n)
        product(a + n * rows * inner, b + n * inner * columns, rows, inner, columns, out + n * rows * columns);
}

int mr_inverses(const double* matrices, size_t count, size_t size, double* out) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<double> work;
        for (size_t n = 0; n < count; ++n) {
            work.assign(matrices + n * size * size, matrices + (n + 1) * size * size);
            invert(work, size, out + n * size * size);
        }
        return MR_OK;
    });
}

int mr_eigen(const double* matrices, size_t count, size_t size, double* values, double* vectors) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<double> work, rows(size * size);
        std::vector<size_t> order(size);
        for (size_t n = 0; n < count; ++n) {
            work.assign(matrices + n * size * size, matrices + (n + 1) * size * size);
            diagonalise(work.data(), rows.data(), size);
            std::iota(order.begin(), order.end(), size_t{0});
            std::stable_sort(order.begin(), order.end(),
                             [&](size_t i, size_t j) { return work[i * (size + 1)] < work[j * (size + 1)]; });
            for (size_t j = 0; j < size; ++j) {
                values[n * size + j] = work[order[j] * (size + 1)];
                for (size_t i = 0; i < size; ++i) vectors[(n * size + i) * size + j] = rows[order[j] * size + i];
            }
        }
        return MR_OK;
    });
}

void mr_exp(const double* x, size_t count, double* out) { std::transform(x, x + count, out, strict_exp); }

void mr_log2(const double* x, size_t count, double* out) { std::transform(x, x + count, out, log2_of); }

void mr_angle(const double* y, const double* x, size_t count, double* out) {
    std::transform(y, y + count, x, out, angle_of);
}
