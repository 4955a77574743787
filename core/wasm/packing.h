// Decoded frames as a graphics processor takes them: vertices of four 16-bit numbers, place and normal. A player's.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Grows a box (three lower, then three upper bounds) so that it holds these places.
void mr_grow_box(const double* positions, size_t vertices, double box[6]);
// The area-weighted sum of the normals of the faces at each vertex, not of unit length. A face that names none of the
// vertices gives 1, and nothing is written; else 0.
int mr_normal_sums(const double* positions, size_t vertices, const int32_t* faces, size_t face_count, double* sums);
// For each vertex x, y and z in 65535ths of the box, and its normal in octahedral form: the first number in the low byte, the
// second in the high one. A sum of zero has the form of +z.
void mr_pack_vertices(const double* positions, const double* sums, size_t vertices, const double box[6], uint16_t* texels);

#ifdef __cplusplus
}
#endif
