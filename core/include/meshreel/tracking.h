// Volume centers: relaxation of one frame (even spread + as-rigid-as-possible), and how differently neighbours move.
// Encoder only. One thread, fixed order of sums. Points are rows of three doubles; every array is the caller's.
#pragma once

#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Neighbours of K centers as lists: those of i are indices[offsets[i] .. offsets[i + 1]), itself not among them.
typedef struct {
    const int32_t* offsets;  // K + 1
    const int32_t* indices;
    const double* weights;  // > 0
} mr_neighbours;

typedef struct {
    const double* samples;  // sample_count x 3, points of the volume
    int64_t sample_count;
    const double* previous;  // center_count x 3, where the centers were; NULL without the rigid term (first frame)
    int64_t center_count;
    mr_neighbours neighbours;  // used with `previous` only
    double spread;             // weight of the even spread (Lloyd), > 0
    double rigidity;           // weight of the rigid term, >= 0
    double tolerance;          // stop when a round can lower the energy by no more than this share of it
    int32_t max_rounds;
} mr_relaxation;

typedef struct {
    double* centers;    // center_count x 3; in: start, out: result
    double* rotations;  // center_count x 9, row by row, previous -> now; NULL without `previous`
    int32_t* owners;    // sample_count: the center nearest to each sample
    double energy;
    int32_t rounds;
} mr_relaxed;

int mr_relax_centers(const mr_relaxation* problem, mr_relaxed* result);

// out[p], for each pair p of the lists (i, j): mean squared distance between where the rigid motions of i and j send
// what i owns, in closed form from its mean (K x 3) and covariance (K x 9). Motions are x -> R x + shift.
int mr_motion_differences(int64_t center_count, const mr_neighbours* neighbours, const double* rotations,
                          const double* shifts, const double* means, const double* covariances, double* out);

#ifdef __cplusplus
}
#endif
