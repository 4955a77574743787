// Range coding of a field's symbols: all columns of a causal graph in one stream, their models shared.
//
// Integers only, in a fixed order. A stream is canonical, as those of entropy.h.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/entropy.h"

#ifdef __cplusplus
extern "C" {
#endif

// The weights' neighbours are those of a causal graph. Status and sizes are as in entropy.h.
// ends[c] is where in the stream column c ends, give or take a byte: its rate.
int meshreel_encode_field(const struct meshreel_weights* weights, uint8_t* out, size_t capacity, size_t* size, size_t* ends);
int meshreel_decode_field(const struct meshreel_weights* weights, const uint8_t* data, size_t size);

#ifdef __cplusplus
}
#endif
