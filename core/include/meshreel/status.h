// Statuses of calls of the C ABI, and arguments that several of them take.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum mr_status {
    MR_OK = 0,
    MR_BAD_INPUT,   // an index out of range or out of order, or a number that is not allowed
    MR_NOT_CAUSAL,  // a graph whose values are near others than those before them
    MR_SINGULAR,    // a connected component has no anchor, or elimination fills in
    MR_NO_MEMORY,
    MR_OVERFLOW,       // a symbol beyond 32 bits
    MR_OUT_TOO_SMALL,  // sizes are set: call again with that much room
    // Bytes of a file that no encoder wrote:
    MR_BAD_STREAM,    // truncated, damaged, or longer than what it holds
    MR_BAD_RECORD,    // the fields of a record do not fit its bytes
    MR_BAD_COLUMNS,   // more columns than numbers in a row, or a step that the ladder does not have
    MR_BAD_BASIS,     // the integers of a basis: see MR_BAD_STREAM
    MR_BAD_SHARED,    // more bits than motion that all vertices share may have
    MR_NO_DIRECTION,  // a basis vector of zeros
    MR_BAD_SYMBOLS,   // the symbols of a field: see MR_BAD_STREAM
    MR_NO_PREVIOUS,   // a level is counted from another group, which the caller does not have
    MR_NOT_FINITE,    // decoded vertices
    // Draco bytes that no encoder of this format wrote:
    MR_NOT_DRACO,         // nor of the one version
    MR_DRACO_CLOUD,       // not a mesh
    MR_DRACO_SEQUENTIAL,  // not edgebreaker
    MR_DRACO_METADATA,
    MR_DRACO_TRAVERSAL,
    MR_DRACO_CLAIMS,  // more faces or points than its bytes may claim
    MR_DRACO_FACES,   // its symbols do not have what it claims
    MR_DRACO_STEPS,   // faces that are joined again and again
    MR_DRACO_ATTRIBUTES,
    MR_DRACO_PREDICTION,
    MR_DRACO_LATTICE,
    MR_BAD_DRACO,  // truncated, damaged, or longer than what it holds
};

// A status in words, without a full stop.
const char* mr_message(int status);

struct mr_bytes {
    const uint8_t* data;
    size_t size;
};

struct mr_mesh {
    const double* positions;  // vertices x 3
    size_t vertices;
    const int32_t* faces;  // face_count x 3
    size_t face_count;
};

#ifdef __cplusplus
}
#endif
