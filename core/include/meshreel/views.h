// Colours of places from pictures: how well a picture shows a place, and its colours there. Encoder only. One thread.
#pragma once

#include "meshreel/raster.h"

#ifdef __cplusplus
extern "C" {
#endif

// A picture of `width` x `height` pixels, and what its camera saw at every `shrink`-th of them: the depth of the
// surface through a lens without bends, infinite for none, and the distance from a step in depth, 255 for far.
struct mr_view {
    struct mr_viewer viewer;  // not parallel
    double eye[3];            // its place in the world
    double bend[8];           // OpenCV's k1 k2 p1 p2 k3 k4 k5 k6
    int32_t bends;            // whether one of these is not 0
    int32_t width, height, shrink;
    const float* depth;        // rows x columns
    const uint8_t* from_step;  // rows x columns
    int32_t rows, columns;     // at least 1
    double margin;             // how far a place may be off the depth, in the unit of lengths,
    double share;              // or as a share of the depth: the larger of both
    double least, at_step;     // the least weight near a step, and the share of its weight that a place at one keeps
    const uint8_t* pixels;     // picture_rows x picture_columns x 3; null: weights alone are wanted
    int32_t picture_rows, picture_columns;  // at least 1
    double gains[3];                        // by which the picture's channels are too bright
};

// Adds to `weights`, for each place, the cube of the cosine of the view, less near steps, 0 where the place is hidden;
// and to `sums`, three for a place, its colour times this weight. `sums` may be null where there are no pixels.
int mr_add_view(const struct mr_view* view, const double* points, const double* normals, size_t count, double* sums,
                double* weights);

#ifdef __cplusplus
}
#endif
