// Decoded frames as a graphics processor takes them: vertices of four 16-bit numbers, place and normal. A player's.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Grows a box (three lower, then three upper bounds) so that it holds these places.
void mr_grow_box(const double* positions, size_t vertices, double box[6]);
// For each vertex x, y and z in 65535ths of the box, and the normal of the faces around it in octahedral form: the
// first number in the low byte, the second in the high one. A vertex without faces has the form of +z.
int mr_pack_vertices(const struct mr_mesh* mesh, const double box[6], uint16_t* texels);

#ifdef __cplusplus
}
#endif
