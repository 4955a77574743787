// Adaptive binary range coding of integers: the weights of a mesh, and small side data. Only integers decide.
//
// A stream is canonical and prefix-free: for given models no stream is the beginning of another, so every truncation
// and every extra byte is an error, without a length in the stream.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Symbols of `columns` components at `count` vertices, column after column; neighbours[starts[v] .. starts[v + 1]) are
// the neighbours of v with a smaller index.
struct mr_weights {
    int32_t* symbols;
    size_t count;
    size_t columns;
    const int64_t* starts;
    const int32_t* neighbours;
    size_t neighbour_count;
};

// One stream a column, one after the other in `out`; sizes[c] bytes each.
int mr_encode_weights(const struct mr_weights* weights, uint8_t* out, size_t capacity, size_t* sizes);
// Fills weights->symbols; on MR_BAD_STREAM *column is the one that failed.
int mr_decode_weights(const struct mr_weights* weights, const uint8_t* data, const size_t* sizes, size_t* column);
// The contexts the coder sees: `classes` of the magnitude (< 15) and `signs` (< 48; 0 for a zero), in the order of the
// symbols.
int mr_weight_contexts(const struct mr_weights* weights, uint8_t* classes, uint8_t* signs);

// All columns in one stream, their models shared; ends[c] is the offset where column c ends, to within a byte. Its
// decoder is mr_decode_field's (layers.h).
int mr_encode_field(const struct mr_weights* weights, uint8_t* out, size_t capacity, size_t* size, size_t* ends);

int mr_encode_integers(const int32_t* values, size_t count, uint8_t* out, size_t capacity, size_t* size);
int mr_decode_integers(const uint8_t* data, size_t size, size_t count, int32_t* values);

#ifdef __cplusplus
}
#endif
