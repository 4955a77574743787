// The stream of a field's symbols: see mr_encode_field.
#pragma once

#include "meshreel/entropy.h"

namespace meshreel {

// Fills symbols that are zero; false where the stream is not theirs. The graph of `weights` must be causal. May throw
// std::bad_alloc.
bool decode_symbols(const mr_weights& weights, const mr_bytes& stream);

}  // namespace meshreel
