// Colours of the vertices of a mesh that moves, coded as fields over the connectivity that its places are coded over.
//
// They decide what a decoder shows, so: IEEE + - * / in a fixed order, no threads.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// A mesh that is subdivided `levels` times, to `vertices` vertices, and shown in `frames` frames.
struct mr_colored {
    const struct mr_mesh* base;
    int levels;
    size_t vertices;
    size_t frames;
    double chroma;         // what a colour difference is multiplied by before it is coded, above 0
    const double* before;  // values in the last frame of the group before, three for each vertex; or null
};

// Decodes a CodedField record and a ColorsLevel record for each level. `colors` gets red, green and blue of each vertex
// in each frame, `last` the values of the last frame, from which another group may be predicted: of a vertex of the
// base its luma and colour differences, of another one how far they are from the mean of those of its edge's ends.
// MR_BAD_RECORD also where the subdivision has another number of vertices.
int mr_decode_colors(const struct mr_colored* colored, const struct mr_bytes* records, uint8_t* colors, double* last);

// Red, green and blue as luma and colour differences, each in -0.5 .. 0.5 (ITU-R BT.709), times `chroma` these two.
// Encoder only.
void mr_color_values(const uint8_t* colors, size_t count, double chroma, double* values);

#ifdef __cplusplus
}
#endif
