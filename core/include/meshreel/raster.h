// Pictures of a triangle mesh: which face each pixel sees, how far away, and where on the face. Encoder only. One
// thread; integers decide which pixels a face covers, so that every build and machine agrees.
#pragma once

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// A camera that looks along +z of its frame, x to the right and y down. The middle of pixel (column i, row j) is at
// i + 1/2, j + 1/2.
struct mr_viewer {
    double turn[9], shift[3];    // world to camera, row by row
    double focal[2], center[2];  // pixels; of a parallel camera `focal` is pixels in a unit of length
    int parallel;                // rays are parallel to z and begin behind everything
};

// A rectangle of pixels.
struct mr_crop {
    int32_t left, top, width, height;
};

// For each pixel of a crop, row by row: the nearest face, of equally near ones that with the least number, -1 for none;
// and its depth along z, infinite for none. Faces are seen from both sides. MR_BAD_INPUT for a face out of range, for a
// crop with a side over 32768, and for numbers that are not finite.
int mr_draw(const struct mr_mesh* mesh, const struct mr_viewer* viewer, const struct mr_crop* crop, int32_t* faces,
            double* depths);

// For each pixel of a drawn crop that sees a face, row by row, the weights of the face's three corners at the place
// that the pixel sees.
int mr_draw_weights(const struct mr_mesh* mesh, const struct mr_viewer* viewer, const struct mr_crop* crop,
                    const int32_t* faces, double* weights);

#ifdef __cplusplus
}
#endif
