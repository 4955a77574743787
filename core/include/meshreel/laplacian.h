// Laplacian coordinates on a triangle mesh (paper, section 3.3.3, eqs. 11-13): the extended operator L*, its forward
// product, its least-squares inverse by a sparse factor, and the encoder's quantizer that shapes the noise for that
// inverse.
//
// Strict arithmetic: IEEE + - * / sqrt in a fixed order, one thread, no trigonometry; every build gives the same bits.
#pragma once

#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct mr_laplacian mr_laplacian;

// L* of a mesh: `vertices` rows of mean-value weights (eq. 11), then a row of `anchor_weight` times a unit
// vector for each anchor; anchors ascend.
int mr_laplacian_create(const struct mr_mesh* mesh, const int32_t* anchors, int64_t anchor_count, double anchor_weight,
                        mr_laplacian** out);
void mr_laplacian_destroy(mr_laplacian* system);

// The directed edges (i, j) in order and the weights w_ij / sum_k w_ik; call with null arrays for the count alone.
int64_t mr_laplacian_weights(const mr_laplacian* system, int32_t* rows, int32_t* columns, double* weights);

// Deltas (V + l) x columns = L* weights (eq. 12); arrays are row-major.
int mr_laplacian_forward(const mr_laplacian* system, const double* weights, int64_t columns, double* deltas);

// Weights V x columns that fit the deltas best (eq. 13). The first call factorises, later ones reuse the factor.
int mr_laplacian_inverse(mr_laplacian* system, const double* deltas, int64_t columns, double* weights);

// The same in one call, for a system that is used once.
int mr_laplacian_solve(const struct mr_mesh* mesh, const int32_t* anchors, int64_t anchor_count, double anchor_weight,
                       const double* deltas, int64_t columns, double* weights);

// Symbols whose inverse is close to the weights: each rounding takes into account the error that those before it leave
// in the *weights*. `prices` are, for each column, the squared error in squared steps that one unit less of a symbol's
// magnitude is worth; 0 rounds without regard to the rate. Encoder only.
int mr_laplacian_quantize(mr_laplacian* system, const double* deltas, int64_t columns, const double* steps,
                          const double* prices, int32_t* symbols);

// `count` vertices or more that are far from each other in edge hops, at least one for each component that has faces.
// Writes at most `vertices` indices and returns how many; negative on bad input.
int64_t mr_farthest_anchors(const int32_t* faces, int64_t face_count, int64_t vertices, int64_t count, int32_t* out);

// Row i of `field` = mean + sum over k of weights[i, k] * vectors[k] (eq. 9), the sum in the order of k.
void mr_klt_inverse(const double* weights, int64_t rows, int64_t columns, const double* vectors, const double* mean,
                    int64_t width, double* field);

#ifdef __cplusplus
}
#endif
