// The decoder as a player's worker calls it: a chunk is opened, dressed with its companions, and packed as a graphics
// processor takes it. What a call made stays until it is closed, and may be what the next chunk is predicted from.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct mr_made;  // a decoded group or a state of the background

struct mr_chunk {
    const uint8_t* data;
    size_t size;
    int32_t frames;                  // of a group; -1 of a background
    int32_t layers;                  // at most, beyond the first; -1: all
    const struct mr_made* previous;  // that it is predicted or changed from, or null
    int32_t is_shown;                // 0: only what the next is predicted from is decoded
    const struct mr_placement* place;
};

// Null where the bytes are refused, or where there is no memory: mr_refusal tells which.
struct mr_made* mr_open_chunk(const struct mr_chunk* chunk);
void mr_close_chunk(struct mr_made* made);
// Leaves what the next chunk is predicted or changed from, and frees the rest.
void mr_trim_chunk(struct mr_made* made);

// Why the last call was refused, in words; empty where it was for want of memory.
const char* mr_refusal(void);

enum { MR_COLORS = 3, MR_ATLAS = 4, MR_SPLATS = 7 };  // kinds of companions (ChunkKind)

// Decodes a companion of a chunk that was opened. A status; the chunk is as before where it is not MR_OK.
int mr_dress_chunk(struct mr_made* made, int kind, const uint8_t* data, size_t size);

// Arrays that stay until the chunk is closed or packed again; null and 0 where there is none.
struct mr_array {
    const void* data;
    size_t bytes;
};

// What types.ts says of PackedGroup and PackedStatic.
struct mr_packed {
    double box[6], unit;  // lower and upper corner; m of level 0 of the splats' scales
    uint32_t vertices, rows, splats, width, height;
    struct mr_array texels, colors, faces, extra, starts, places, extra_places, words;
};

// `is_textured`: whether places of corners are wanted. Null where it is refused.
const struct mr_packed* mr_pack_chunk(struct mr_made* made, int is_textured);

// A frame as it was decoded, and its splats.
struct mr_shown {
    struct mr_array vertices, faces, colors, means, axes, scales, opacities, splat_colors;
};

const struct mr_shown* mr_show_frame(struct mr_made* made, size_t frame);

#ifdef __cplusplus
}
#endif
