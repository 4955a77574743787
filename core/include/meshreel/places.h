// Places of a mesh's corners in a texture, in texels, predicted from face to face: a corner is where the shape of its
// face has it beside the face before.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// What places are coded as. Faces are followed over their edges, from the first that has no place yet.
struct mr_place_symbols {
    int32_t *joins, *starts, *rests;  // whether faces share an edge's places, or a corner's; first places; differences
    size_t join_count, start_count, rest_count;
};

// `places` has two numbers for each of the three corners of each face. There is room for 4 joins, 6 starts and 2 rests
// of each face; the counts are set. Encoder only.
int mr_encode_places(const struct mr_mesh* mesh, const int32_t* places, struct mr_place_symbols* symbols);

// MR_BAD_RECORD where there are fewer or more symbols than the mesh needs, or where a place is beyond 2^20.
int mr_decode_places(const struct mr_mesh* mesh, const struct mr_place_symbols* symbols, int32_t* places);

#ifdef __cplusplus
}
#endif
