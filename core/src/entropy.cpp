#include "meshreel/entropy.h"

#include <cstring>
#include <new>
#include <vector>

#include "meshreel/range_coder.h"

namespace meshreel {
namespace {

constexpr int kClasses = 15;    // of expected magnitude
constexpr int kSigns = 27;      // signs around: neighbours x previous column x the one before
constexpr int kUnary = 20;      // magnitudes below have a model a step; above, an Exp-Golomb escape
constexpr int kClamp = 255;     // larger magnitudes say no more about the scale
constexpr size_t kNearest = 32; // neighbours looked at, the last in order

// Where a class begins, in sixteenths of a step of expected magnitude.
constexpr uint32_t kBegin[kClasses - 1] = {1, 5, 9, 14, 20, 28, 40, 64, 100, 160, 300, 600, 1200, 2400};
constexpr uint32_t kLastBegin = kBegin[kClasses - 2];

constexpr std::array<uint8_t, kLastBegin + 1> class_table() {
    std::array<uint8_t, kLastBegin + 1> table{};
    uint8_t index = 0;
    for (uint32_t e = 0; e <= kLastBegin; ++e) {
        while (index < kClasses - 1 && e >= kBegin[index]) ++index;
        table[e] = index;
    }
    return table;
}
constexpr auto kClassOf = class_table();

constexpr std::array<uint32_t, kNearest + 1> sixteenths() {
    std::array<uint32_t, kNearest + 1> table{};
    for (uint32_t n = 1; n <= kNearest; ++n) table[n] = (16u << 16) / n;
    return table;
}
constexpr auto kSixteenths = sixteenths();

constexpr uint64_t kFirstRatio = 1u << 11;  // a column about as large as the one before

int sign(int value) { return (value > 0) - (value < 0); }
int clamped(int32_t value) { return value > kClamp ? kClamp : value < -kClamp ? -kClamp : value; }
uint32_t magnitude(int value) { return static_cast<uint32_t>(value < 0 ? -value : value); }

// Exp-Golomb with adaptive exponent and leading mantissa bits, for values 0 .. 2^32 - 2.
struct EscapeModels {
    Model exponent[32];
    Model mantissa[32][4];
};

template <class Coder>
uint64_t code_escape(Coder& coder, EscapeModels& models, uint64_t value) {
    int length = 0;
    while (length < 32 && coder.bit(models.exponent[length < 31 ? length : 31], (value + 1) >> (length + 1) != 0)) ++length;
    uint64_t read = 1;
    for (int k = length - 1; k >= 0; --k) {
        const bool bit = (value + 1) >> k & 1;
        const bool leading = k >= length - 2;
        const bool coded = leading ? coder.bit(models.mantissa[length - 1][k == length - 1 ? 1 : 2 + (read & 1)], bit) : coder.raw_bit(bit);
        read = read << 1 | static_cast<uint64_t>(coded);
    }
    return read - 1;
}

struct WeightModels {
    Model zero[kClasses];
    Model sign[kSigns];
    Model more[kClasses][kUnary];
    EscapeModels escape;
};

template <class Coder>
int64_t code_weight(Coder& coder, WeightModels& models, int context, int signs, int64_t value) {
    const uint64_t size = static_cast<uint64_t>(value < 0 ? -value : value);
    if (!coder.bit(models.zero[context], size != 0)) return 0;
    const bool negative = coder.bit(models.sign[signs], value < 0);
    uint64_t read = 1;
    while (read < kUnary && coder.bit(models.more[context][read], size > read)) ++read;
    if (read == kUnary) read += code_escape(coder, models.escape, size - kUnary);
    return negative ? -static_cast<int64_t>(read) : static_cast<int64_t>(read);
}

bool fits(int64_t value) { return value >= INT32_MIN && value <= INT32_MAX; }

// What has been coded, as the contexts of what comes next. Columns before the current one are known at every vertex,
// the current one at smaller indices.
class Surroundings {
public:
    explicit Surroundings(const meshreel_weights& weights)
        : weights_(weights), current_(weights.count), past_(weights.count), signs_(weights.count, 4), sums_(weights.count), degrees_(weights.count) {
        for (size_t v = 0; v < weights.count; ++v) {
            for (int64_t k = weights.starts[v]; k < weights.starts[v + 1]; ++k) {
                ++degrees_[v];
                ++degrees_[static_cast<size_t>(weights.neighbours[k])];
            }
        }
    }

    struct Context {
        int size;
        int signs;
        uint32_t past;
    };

    Context at(size_t v) const {
        size_t begin = static_cast<size_t>(weights_.starts[v]);
        const size_t end = static_cast<size_t>(weights_.starts[v + 1]);
        if (end - begin > kNearest) begin = end - kNearest;
        uint32_t sum = 0;
        int total = 0;
        for (size_t k = begin; k < end; ++k) {
            const int near = current_[static_cast<size_t>(weights_.neighbours[k])];
            sum += magnitude(near);
            total += near;
        }
        uint32_t expected;  // sixteenths
        if (end > begin) {
            expected = sum * kSixteenths[end - begin] >> 16;
        } else {  // a vertex of the mesh before its subdivision: those coded just before lie near
            expected = 8 * ((v > 0 ? magnitude(current_[v - 1]) : 0) + (v > 1 ? magnitude(current_[v - 2]) : 0));
            total = v > 0 ? current_[v - 1] : 0;
        }
        if (column_ > 0) expected = (2 * expected + 3 * scaled(past_[v])) / 5;
        const int size = kClassOf[expected < kLastBegin ? expected : kLastBegin];
        return {size, (sign(total) + 1) * 9 + signs_[v], past_[v]};
    }

    void learn(size_t v, int32_t value, uint32_t past) {
        current_[v] = static_cast<int16_t>(clamped(value));
        seen_ += 16 * magnitude(current_[v]);
        expected_ += past;
        if (++age_ == 64) rescale();
    }

    // Ends a column: it joins the past, in which each step back weighs 45 / 64.
    void next_column() {
        for (size_t v = 0; v < weights_.count; ++v) {
            for (int64_t k = weights_.starts[v]; k < weights_.starts[v + 1]; ++k) {
                const size_t u = static_cast<size_t>(weights_.neighbours[k]);
                sums_[v] += magnitude(current_[u]);
                sums_[u] += magnitude(current_[v]);
            }
        }
        for (size_t v = 0; v < weights_.count; ++v) {
            const uint32_t around = degrees_[v] ? 16 * sums_[v] / degrees_[v] : 0;
            past_[v] = past_[v] * 45 / 64 + 16 * (128 * magnitude(current_[v]) + around) / 9;
            signs_[v] = static_cast<uint8_t>((sign(current_[v]) + 1) * 3 + signs_[v] / 3);
            sums_[v] = 0;
        }
        ++column_;
        seen_ = expected_ = 0;
        age_ = 0;
        ratio_ = kFirstRatio;
    }

private:
    uint32_t scaled(uint32_t past) const { return static_cast<uint32_t>((static_cast<uint64_t>(past) * ratio_) >> 16); }

    // The past says where a column is large; how large against the past is learned, with a memory of 400 vertices.
    void rescale() {
        age_ = 0;
        ratio_ = ((seen_ << 16) + 1024 * kFirstRatio) / (expected_ + 1024);
        if (ratio_ > 1u << 20) ratio_ = 1u << 20;
        seen_ -= seen_ / 6;
        expected_ -= expected_ / 6;
    }

    const meshreel_weights& weights_;
    std::vector<int16_t> current_;
    std::vector<uint32_t> past_;
    std::vector<uint8_t> signs_;  // (previous + 1) * 3 + (the one before + 1)
    std::vector<uint32_t> sums_;
    std::vector<uint32_t> degrees_;
    size_t column_ = 0;
    uint64_t seen_ = 0;
    uint64_t expected_ = 0;
    uint64_t ratio_ = kFirstRatio;
    uint32_t age_ = 0;
};

// One column through a coder, either way; false where the bytes are bad.
template <class Coder>
bool code_column(Coder& coder, Surroundings& around, int32_t* column, size_t count) {
    WeightModels models;
    for (size_t v = 0; v < count; ++v) {
        const auto context = around.at(v);
        const int64_t value = code_weight(coder, models, context.size, context.signs, column[v]);
        if (coder.failed() || !fits(value)) return false;
        column[v] = static_cast<int32_t>(value);
        around.learn(v, column[v], context.past);
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
    for (int k = 5; k >= 0; --k) node = node << 1 | static_cast<uint32_t>(coder.bit(models.length[node], bits >> k & 1));
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

bool are_causal(const meshreel_weights& weights) {
    if (weights.starts[0] != 0 || weights.starts[weights.count] != static_cast<int64_t>(weights.neighbour_count)) return false;
    for (size_t v = 0; v < weights.count; ++v) {
        if (weights.starts[v] > weights.starts[v + 1] || weights.starts[v + 1] > static_cast<int64_t>(weights.neighbour_count)) return false;
        for (int64_t k = weights.starts[v]; k < weights.starts[v + 1]; ++k) {
            const int64_t u = weights.neighbours[k];
            if (u < 0 || u >= static_cast<int64_t>(v)) return false;
        }
    }
    return true;
}

// A coded bit costs at least -log2(65520 / 65536) = 1 / 2840 bit: a stream can say no more than this many symbols.
bool is_plausible(size_t count, size_t size) { return count / 22800 <= size + 3; }

int copy_out(const std::vector<uint8_t>& bytes, uint8_t* out, size_t capacity) {
    if (bytes.size() > capacity) return MESHREEL_ENTROPY_OUT_TOO_SMALL;
    if (!bytes.empty()) std::memcpy(out, bytes.data(), bytes.size());
    return MESHREEL_ENTROPY_OK;
}

// Runs `body`, which may throw only for want of memory; nothing is thrown across the C ABI.
template <class Body>
int guarded(Body body) {
    try {
        return body();
    } catch (...) {
        return MESHREEL_ENTROPY_NO_MEMORY;
    }
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int meshreel_encode_weights(const meshreel_weights* weights, uint8_t* out, size_t capacity, size_t* sizes) {
    if (!are_causal(*weights)) return MESHREEL_ENTROPY_BAD_INPUT;
    return guarded([&] {
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

int meshreel_decode_weights(const meshreel_weights* weights, const uint8_t* data, const size_t* sizes, size_t* column) {
    if (!are_causal(*weights)) return MESHREEL_ENTROPY_BAD_INPUT;
    return guarded([&]() -> int {
        Surroundings around(*weights);
        for (size_t c = 0; c < weights->columns; data += sizes[c], ++c) {
            *column = c;
            if (weights->count == 0) {
                if (sizes[c] != 0) return MESHREEL_ENTROPY_BAD_STREAM;
                continue;
            }
            RangeDecoder coder(data, sizes[c]);
            int32_t* symbols = weights->symbols + c * weights->count;
            std::memset(symbols, 0, weights->count * sizeof(int32_t));
            if (!is_plausible(weights->count, sizes[c]) || !code_column(coder, around, symbols, weights->count)) {
                return MESHREEL_ENTROPY_BAD_STREAM;
            }
        }
        return MESHREEL_ENTROPY_OK;
    });
}

int meshreel_weight_contexts(const meshreel_weights* weights, uint8_t* classes, uint8_t* signs) {
    if (!are_causal(*weights)) return MESHREEL_ENTROPY_BAD_INPUT;
    return guarded([&] {
        Surroundings around(*weights);
        for (size_t c = 0; c < weights->columns; ++c) {
            for (size_t v = 0; v < weights->count; ++v) {
                const auto context = around.at(v);
                *classes++ = static_cast<uint8_t>(context.size);
                *signs++ = static_cast<uint8_t>(context.signs);
                around.learn(v, weights->symbols[c * weights->count + v], context.past);
            }
            around.next_column();
        }
        return static_cast<int>(MESHREEL_ENTROPY_OK);
    });
}

int meshreel_encode_integers(const int32_t* values, size_t count, uint8_t* out, size_t capacity, size_t* size) {
    return guarded([&] {
        std::vector<uint8_t> bytes;
        RangeEncoder coder(bytes);
        IntegerModels models;
        for (size_t k = 0; k < count; ++k) code_integer(coder, models, values[k]);
        if (count > 0) coder.finish();
        *size = bytes.size();
        return copy_out(bytes, out, capacity);
    });
}

int meshreel_decode_integers(const uint8_t* data, size_t size, size_t count, int32_t* values) {
    if (count == 0) return size == 0 ? MESHREEL_ENTROPY_OK : MESHREEL_ENTROPY_BAD_STREAM;
    if (!is_plausible(count, size)) return MESHREEL_ENTROPY_BAD_STREAM;
    RangeDecoder coder(data, size);
    IntegerModels models;
    for (size_t k = 0; k < count; ++k) {
        const int64_t value = code_integer(coder, models, 0);
        if (coder.failed() || !fits(value)) return MESHREEL_ENTROPY_BAD_STREAM;
        values[k] = static_cast<int32_t>(value);
    }
    return coder.finish() ? MESHREEL_ENTROPY_OK : MESHREEL_ENTROPY_BAD_STREAM;
}
