// The decoder of .reel files as a C ABI, for engines and for other languages: format version 1, all forms.
//
// A handle is a file that is open. Handles share nothing: each may be used by one thread at a time, several by several
// threads. No call throws, and none ends the process. What a file can make a call take of memory and time is bounded
// by its bytes (FORMAT.md, "What a file may cost"): a file that asks for more is refused as damaged.
//
// Not here: the decoding of textures and of audio, which engines have. Places of corners (UV), the coded packets, AV1
// and H.264, and the audio file are handed out as they are.
#pragma once

#include <stddef.h>
#include <stdint.h>

#if defined(MESHREEL_STATIC)
#define MESHREEL_API
#elif defined(_WIN32) && defined(MESHREEL_BUILD)
#define MESHREEL_API __declspec(dllexport)
#elif defined(_WIN32)
#define MESHREEL_API __declspec(dllimport)
#else
#define MESHREEL_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

// Grows with every change after which programs that were compiled before would go wrong.
#define MESHREEL_ABI_VERSION 1
MESHREEL_API uint32_t meshreel_abi_version(void);

// Status of a call; meshreel_last_error has it in words.
enum {
    MESHREEL_OK = 0,
    MESHREEL_BAD_ARGUMENT = 1,  // a null pointer, or a frame or a part that is not there
    MESHREEL_DAMAGED = 2,       // bytes that no encoder wrote; the chunk that has them is not decoded again
    MESHREEL_UNREADABLE = 3,    // the source of bytes failed, or the file is not whole yet
    MESHREEL_NO_MEMORY = 4
};

typedef struct meshreel_video meshreel_video;

// Copies `length` bytes from `offset` to `out` and returns how many: fewer are a failure. It is called by the thread
// that calls the library, and only within that call.
typedef int64_t (*meshreel_read)(void* context, uint64_t offset, uint64_t length, uint8_t* out);

// Opens a file of `size` bytes that is read by ranges: its head now, chunks as frames need them. `*video` is set
// whatever is returned, null only without memory, so that meshreel_last_error can tell why; it is to be closed anyway.
MESHREEL_API int32_t meshreel_open(meshreel_read read, void* context, uint64_t size, meshreel_video** video);
// The same of a file in memory, which must stay there until it is closed; it is not copied.
MESHREEL_API int32_t meshreel_open_memory(const uint8_t* data, uint64_t size, meshreel_video** video);
MESHREEL_API void meshreel_close(meshreel_video* video);

// Why the last call on this handle failed, or what it left out, in English; "" where all was well. Valid until the next
// call. "no memory" for null.
MESHREEL_API const char* meshreel_last_error(const meshreel_video* video);

enum { MESHREEL_UP_Y = 0, MESHREEL_UP_Z = 1, MESHREEL_UP_MINUS_Y = 2, MESHREEL_UP_MINUS_Z = 3 };

typedef struct meshreel_info {
    uint64_t frames;
    double frame_rate;  // 1/s
    double duration;    // s
    double origin[3];   // m; single precision loses least about it (meshreel_round)
    double scale;       // m of the file's unit of length
    double minimum[3];  // of a box around all moving bodies in all frames, m
    double maximum[3];
    uint32_t tracks;  // moving bodies
    uint32_t layers;  // the most that a group has beyond its first
    int32_t up;       // MESHREEL_UP_...
    uint8_t has_background, has_colors, has_textures, has_splats;
} meshreel_info;

MESHREEL_API int32_t meshreel_get_info(meshreel_video* video, meshreel_info* info);
// The time at which a frame is shown, s.
MESHREEL_API int32_t meshreel_time(meshreel_video* video, uint64_t frame, double* seconds);
// The encoder's metadata, a JSON object in UTF-8, ended by 0. Valid until the file is closed.
MESHREEL_API const char* meshreel_metadata(const meshreel_video* video);

// Decodes from at most so many layers of each group beyond its first, so that fewer bytes are read and meshes are
// coarser; -1, as at first: from all. Backgrounds have no layers.
MESHREEL_API int32_t meshreel_set_layers(meshreel_video* video, int32_t layers);

// Parts of a frame; a number from 0 is that of a track.
enum { MESHREEL_WHOLE = -1, MESHREEL_BACKGROUND = -2 };

// Vertices and faces; valid until the next call on the handle but meshreel_last_error. A part that is not in the frame
// has no vertices.
typedef struct meshreel_mesh {
    uint64_t vertex_count, face_count;
    const double* positions;  // x, y, z of each vertex, m
    const int32_t* faces;     // three vertices of each face, counter-clockwise from outside
    const uint8_t* colors;    // red, green and blue of each vertex, sRGB; null where there are none
    const float* uv;          // of each corner of each face, right and up, 0 to 1; NaN where a face has none; null for
                              // parts without a texture, and for MESHREEL_WHOLE, which may have several
    uint64_t identity;        // equal for meshes of one part that are the same but for their positions and colours
} meshreel_mesh;

// Decodes a part of a frame, or the background and then all tracks as one mesh. Frames in order cost least: a group is
// decoded once. Colours and places that are damaged are left out, and meshreel_last_error says so.
MESHREEL_API int32_t meshreel_decode(meshreel_video* video, uint64_t frame, int32_t part, meshreel_mesh* mesh);

// Positions less `about` (three numbers, or null) in single precision; `out` has room for 3 vertex_count numbers.
MESHREEL_API void meshreel_round(const meshreel_mesh* mesh, const double* about, float* out);

enum { MESHREEL_AV1 = 1, MESHREEL_H264 = 2 };

// A coded picture. It can be shown once all pictures of its stream before it have been decoded, in order.
typedef struct meshreel_packet {
    const uint8_t* data;  // AV1: a temporal unit, OBUs with sizes; H.264: an access unit with start codes
    uint64_t size;
    uint64_t stream;  // a number of the video; a decoder begins anew where it is another
    uint64_t number;  // of the picture in its stream, from 0
    uint32_t width, height;
} meshreel_packet;

// The picture of the texture of a track or of the background in a frame, in one of both codings; valid as a mesh is.
// `data` is null where there is none.
MESHREEL_API int32_t meshreel_picture(meshreel_video* video, uint64_t frame, int32_t part, int32_t codec,
                                      meshreel_packet* packet);

enum { MESHREEL_OGG = 1, MESHREEL_WEBM = 2, MESHREEL_MP4 = 3, MESHREEL_ADTS = 4, MESHREEL_MPEG = 5 };

// The audio file that belongs to the frames, as it was given to the encoder.
typedef struct meshreel_sound {
    const uint8_t* data;
    uint64_t size;
    double start;  // s after frame 0; below 0: its beginning is skipped
    int32_t type;  // OGG and WEBM have Opus, MP4 and ADTS have AAC, MPEG is MP3
} meshreel_sound;

// The audio of a file, valid until the next call on the handle but meshreel_last_error. `data` is null where there is
// none.
MESHREEL_API int32_t meshreel_audio(meshreel_video* video, meshreel_sound* sound);

// Flat Gaussians in space, of each its numbers side by side. They are drawn in place of the surface of their track,
// from front to back, each exp(-(u^2 / s0^2 + v^2 / s1^2 + w^2 / s2^2) / 2) of the distances from its mean along its
// axes.
typedef struct meshreel_splats {
    uint64_t count;
    const double* means;      // three, m
    const double* axes;       // nine: three unit vectors
    const double* scales;     // three, along these, m
    const double* opacities;  // one, 0 to 1; 0 where the frame lacks its face
    const double* colors;     // three, sRGB, 0 to 1
} meshreel_splats;

// The splats of a track in a frame, none where it has none; valid as a mesh is.
MESHREEL_API int32_t meshreel_decode_splats(meshreel_video* video, uint64_t frame, int32_t track,
                                            meshreel_splats* splats);

#ifdef __cplusplus
}
#endif
