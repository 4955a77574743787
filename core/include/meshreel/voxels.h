// Truncated signed distances in blocks of 8 x 8 x 8 voxels: depth pictures that are fused into them, and the surface
// where they are 0. Encoder only. One thread; the same input always gives the same bits.
#pragma once

#include <stddef.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { MR_BLOCK_SIDE = 8, MR_BLOCK_VOXELS = 512 };

// Depths along the optical axis, rows x columns; 0: none. Pixel (column, row) is around (column + 0.5, row + 0.5).
struct mr_depth {
    const float* depths;
    size_t rows, columns;
    const double* projection;  // 3 x 4, from the world to homogeneous coordinates of pixels, the last of them the depth
    const double* ways;        // 3 x 3, from homogeneous coordinates of pixels to ways in the world that go 1 ahead
    const double* eye;
};

// Voxel (i, j, k) of a block is at (8 block + (i, j, k)) voxel, and the number (8 k + j) 8 + i of the block's.
struct mr_blocks {
    const int32_t* blocks;  // count x 3
    size_t count;
    double voxel;
    float *distances, *weights;  // count x 512; distances are positive outside
};

// The blocks that have something within `reach`, in the unit of `voxel`, before or behind the depth of every fourth
// pixel of every fourth row, ascending. `out` keeps them.
typedef struct mr_touched mr_touched;
int mr_touched_create(const struct mr_depth* picture, double voxel, double reach, mr_touched** out,
                      const int32_t** blocks, size_t* count);
void mr_touched_destroy(mr_touched* touched);

// Takes a picture into the mean distances of voxels, in units of `reach` and at most 1; what is farther behind a depth
// is left as it is. A measurement has the weight 1.
int mr_integrate(const struct mr_depth* picture, double reach, const struct mr_blocks* into);

// Points on surfaces, with normals that point outside; coordinates are less than 1e8 blocks from 0.
struct mr_oriented {
    const double *positions, *normals;  // count x 3
    size_t count;
};

// Sets the distances, in units of `radius`, of the voxels within `radius` of points, at most a block's side, and their
// weights to 1: the mean distance from the planes of these points, near ones more. A voxel that is more than `past`
// aside of the mean of its points is past the border of a surface, and left as it is. Blocks must be ascending and
// distinct, and less than 1e8 from 0: MR_BAD_INPUT. Points in others do not count.
int mr_point_distances(const struct mr_oriented* points, double radius, double past, const struct mr_blocks* into);

// The surface where distances change their sign, between voxels whose weight is above `least`, by marching cubes; it
// faces positive distances. Blocks must be ascending and distinct: MR_BAD_INPUT. `out` keeps the mesh.
typedef struct mr_zero mr_zero;
int mr_zero_create(const struct mr_blocks* of, float least, mr_zero** out, struct mr_mesh* mesh);
void mr_zero_destroy(mr_zero* zero);

#ifdef __cplusplus
}
#endif
