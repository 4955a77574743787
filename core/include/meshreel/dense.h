// Small dense algebra of the encoder whose bits do not depend on the processor: one thread, sums in a fixed order, and
// exp, log2 and angles of + - * / sqrt only. Matrices are stored row by row, batches one matrix after the other.
#pragma once

#include <stddef.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// out[n] = a[n] b[n] for each of `count` matrices, rows x inner and inner x columns; summed in the order of `inner`.
void mr_products(const double* a, const double* b, size_t count, size_t rows, size_t inner, size_t columns,
                 double* out);

// Inverts `count` matrices of size x size; one without an inverse becomes numbers that are not finite.
int mr_inverses(const double* matrices, size_t count, size_t size, double* out);

// Eigenvalues, in ascending order, and eigenvectors, in columns, of `count` symmetric matrices of size x size.
int mr_eigen(const double* matrices, size_t count, size_t size, double* values, double* vectors);

void mr_exp(const double* x, size_t count, double* out);
void mr_log2(const double* x, size_t count, double* out);

// The angles of the points (x, y) with the x-axis, rad; x and y are not negative. The angle of (0, 0) is 0.
void mr_angle(const double* y, const double* x, size_t count, double* out);

#ifdef __cplusplus
}
#endif
