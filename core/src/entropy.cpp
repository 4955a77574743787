#include "meshreel/entropy.h"

#include <cstring>
#include <vector>

#include "arrays.h"
#include "escape.h"
#include "guarded.h"
#include "range_coder.h"
#include "weight_contexts.h"

namespace meshreel {
namespace {

struct WeightModels {
    Model zero[kClasses];
    Model sign[kSigns];
    Model more[kClasses][kUnary];
    EscapeModels escape;
};

template <class Coder>
int64_t code_weight(Coder& coder, WeightModels& models, int context, int64_t predicted, int64_t value) {
    const uint64_t size = static_cast<uint64_t>(value < 0 ? -value : value);
    if (!coder.bit(models.zero[context], size != 0)) return 0;
    uint64_t read = 1;
    while (read < kUnary && coder.bit(models.more[context][read], size > read)) ++read;
    if (read == kUnary) read += code_escape(coder, models.escape, size - kUnary);
    const bool negative = coder.bit(models.sign[sign_context(predicted, read)], value < 0);
    return negative ? -static_cast<int64_t>(read) : static_cast<int64_t>(read);
}

// One column through a coder, either way; false where the bytes are bad.
template <class Coder>
bool code_column(Coder& coder, Surroundings& around, int32_t* column, size_t count) {
    WeightModels models;
    for (size_t v = 0; v < count; ++v) {
        const auto context = around.at(v);
        const int64_t value = code_weight(coder, models, context.size, context.predicted, column[v]);
        if (coder.failed() || !fits(value)) return false;
        column[v] = static_cast<int32_t>(value);
        around.learn(v, column[v]);
    }
    around.next_column();
    return coder.finish();
}

// Bit length by a binary tree, sign, then the mantissa with three adaptive leading bits.
struct IntegerModels {
    Model length[64];
    Model sign;
    Model mantissa[33][8];
};

template <class Coder>
int64_t code_integer(Coder& coder, IntegerModels& models, int64_t value) {
    const uint64_t size = static_cast<uint64_t>(value < 0 ? -value : value);
    int bits = 0;
    while (size >> bits) ++bits;
    uint32_t node = 1;
    for (int k = 5; k >= 0; --k)
        node = node << 1 | static_cast<uint32_t>(coder.bit(models.length[node], bits >> k & 1));
    const int length = static_cast<int>(node & 63);
    if (length == 0) return 0;
    if (length > 32) return INT64_MAX;  // no such integer
    const bool negative = coder.bit(models.sign, value < 0);
    uint64_t read = 1;
    for (int k = length - 2; k >= 0; --k) {
        const bool bit = size >> k & 1;
        const bool coded = read < 8 ? coder.bit(models.mantissa[length][read], bit) : coder.raw_bit(bit);
        read = read << 1 | static_cast<uint64_t>(coded);
    }
    return negative ? -static_cast<int64_t>(read) : static_cast<int64_t>(read);
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_encode_weights(const mr_weights* weights, uint8_t* out, size_t capacity, size_t* sizes) {
    if (!is_causal(*weights)) return MR_NOT_CAUSAL;
    return guarded(MR_NO_MEMORY, [&] {
        std::vector<uint8_t> bytes;
        Surroundings around(*weights);
        for (size_t c = 0; c < weights->columns; ++c) {
            const size_t begin = bytes.size();
            RangeEncoder coder(bytes);
            if (weights->count > 0) code_column(coder, around, weights->symbols + c * weights->count, weights->count);
            sizes[c] = bytes.size() - begin;
        }
        return copy_out(bytes, out, capacity);
    });
}

int mr_decode_weights(const mr_weights* weights, const uint8_t* data, const size_t* sizes, size_t* column) {
    if (!is_causal(*weights)) return MR_NOT_CAUSAL;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        Surroundings around(*weights);
        for (size_t c = 0; c < weights->columns; data += sizes[c], ++c) {
            *column = c;
            if (weights->count == 0) {
                if (sizes[c] != 0) return MR_BAD_STREAM;
                continue;
            }
            RangeDecoder coder(data, sizes[c]);
            int32_t* symbols = weights->symbols + c * weights->count;
            std::memset(symbols, 0, weights->count * sizeof(int32_t));
            if (!is_plausible(weights->count, sizes[c]) || !code_column(coder, around, symbols, weights->count)) {
                return MR_BAD_STREAM;
            }
        }
        return MR_OK;
    });
}

int mr_weight_contexts(const mr_weights* weights, uint8_t* classes, uint8_t* signs) {
    if (!is_causal(*weights)) return MR_NOT_CAUSAL;
    return guarded(MR_NO_MEMORY, [&] {
        Surroundings around(*weights);
        for (size_t c = 0; c < weights->columns; ++c) {
            for (size_t v = 0; v < weights->count; ++v) {
                const auto context = around.at(v);
                const int32_t value = weights->symbols[c * weights->count + v];
                *classes++ = static_cast<uint8_t>(context.size);
                const uint64_t size = magnitude(clamped(value));
                *signs++ = static_cast<uint8_t>(size ? sign_context(context.predicted, size) : 0);
                around.learn(v, value);
            }
            around.next_column();
        }
        return static_cast<int>(MR_OK);
    });
}

int mr_encode_integers(const int32_t* values, size_t count, uint8_t* out, size_t capacity, size_t* size) {
    return guarded(MR_NO_MEMORY, [&] {
        std::vector<uint8_t> bytes;
        RangeEncoder coder(bytes);
        IntegerModels models;
        for (size_t k = 0; k < count; ++k) code_integer(coder, models, values[k]);
        if (count > 0) coder.finish();
        *size = bytes.size();
        return copy_out(bytes, out, capacity);
    });
}

int mr_decode_integers(const uint8_t* data, size_t size, size_t count, int32_t* values) {
    if (count == 0) return size == 0 ? MR_OK : MR_BAD_STREAM;
    if (!is_plausible(count, size)) return MR_BAD_STREAM;
    RangeDecoder coder(data, size);
    IntegerModels models;
    for (size_t k = 0; k < count; ++k) {
        const int64_t value = code_integer(coder, models, 0);
        if (coder.failed() || !fits(value)) return MR_BAD_STREAM;
        values[k] = static_cast<int32_t>(value);
    }
    return coder.finish() ? MR_OK : MR_BAD_STREAM;
}
