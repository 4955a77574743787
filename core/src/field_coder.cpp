#include "field_coder.h"

#include <algorithm>
#include <vector>

#include "arrays.h"
#include "escape.h"
#include "guarded.h"
#include "magnitude_classes.h"
#include "range_coder.h"
#include "scratch.h"
#include "wide.h"

namespace meshreel {
namespace {

constexpr size_t kBlock = 64;  // places between two updates of the ratio (guess)

constexpr ClassTable<5> kClassOf;  // of five times the expected magnitude: it is a fifth of a whole number

// What has been coded, as the context of what comes next: in this column at earlier places, in earlier columns here.
class Magnitudes {
public:
    explicit Magnitudes(const mr_weights& weights)
        : count_(weights.count),
          sums_(count_),
          shares_(count_),
          past_(count_),
          bases_(count_),
          now_(count_),
          classes_(count_),
          starts_(count_ + 1) {
        const auto each_link = [&](auto&& visit) {  // a place that none predicts looks at the one before it
            for (size_t v = 0; v < count_; ++v) {
                const int64_t begin = weights.starts[v], end = weights.starts[v + 1];
                for (int64_t k = begin; k < end; ++k) visit(static_cast<size_t>(weights.neighbours[k]), v);
                if (begin == end && v > 0) visit(v - 1, v);
            }
        };
        each_link([&](size_t u, size_t) { ++starts_[u + 1]; });
        for (size_t v = 0; v < count_; ++v) {
            const int64_t links = std::max<int64_t>(weights.starts[v + 1] - weights.starts[v], 1);
            shares_[v] = static_cast<uint32_t>((int64_t{16} << 16) / links);
            starts_[v + 1] += starts_[v];
        }
        followers_.resize(starts_[count_]);
        std::vector<size_t> next(starts_.begin(), starts_.end() - 1);
        each_link([&](size_t u, size_t v) { followers_[next[u]++] = static_cast<int32_t>(v); });
    }

    // The places of a block in a column are coded between these two.
    void begin_block(size_t first, size_t places) {
        wide([&] { expect(first, places); });
    }
    // The past predicts where a column is large; the ratio to the past is learned, with a memory of 400 places.
    void end_block(size_t places) {
        if (places < kBlock) return;
        ratio_ = ((seen_ << 16) + 1024 * kFirstRatio) / (expected_ + 1024);
        if (ratio_ > 1u << 20) ratio_ = 1u << 20;
        seen_ -= seen_ / 6;
        expected_ -= expected_ / 6;
    }

    const uint8_t* classes() const { return classes_.data(); }  // right for what is coded next in a block

    void learn(size_t v, int64_t value) {  // of values that are not zero
        const int64_t size = value < 0 ? -value : value;
        const uint8_t known = static_cast<uint8_t>(size < kClamp ? size : kClamp);
        now_[v] = known;
        seen_ += 16u * known;
        for (size_t k = starts_[v], end = starts_[v + 1]; k < end; ++k) {
            const size_t follower = static_cast<size_t>(followers_[k]);
            sums_[follower] += known;
            classes_[follower] = kClassOf[expected_at(follower)];  // beyond the block it is not final
        }
    }

    // Ends a column: it joins the past, in which each step back weighs 45 / 64.
    void next_column() {
        for (size_t v = 0; v < count_; ++v) past_[v] = past_[v] * 45 / 64 + 16u * 128u * now_[v] / 9;
        std::fill(now_.begin(), now_.end(), static_cast<uint8_t>(0));
        std::fill(sums_.begin(), sums_.end(), 0u);
        trust_ = 2;
        seen_ = expected_ = 0;
        ratio_ = kFirstRatio;
    }

private:
    void expect(size_t first, size_t places) {
        const uint32_t* past = past_.data() + first;
        uint32_t* base = bases_.data() + first;
        uint32_t expected[kBlock];
        for (size_t k = 0; k < places; ++k) expected_ += past[k];
        for (size_t k = 0; k < places; ++k) base[k] = 3 * static_cast<uint32_t>(past[k] * ratio_ >> 16);
        for (size_t k = 0; k < places; ++k) expected[k] = expected_at(first + k);
        for (size_t k = 0; k < places; ++k) classes_[first + k] = kClassOf[expected[k]];
    }
    uint32_t expected_at(size_t v) const {  // the product fits: a share is 2^20 / n, a sum at most n magnitudes of 255
        const uint32_t around = sums_[v] * shares_[v] >> 16;  // sixteenths
        return around * trust_ + bases_[v];
    }

    size_t count_;
    Array<uint32_t> sums_;    // of the magnitudes at the neighbours of each place, as far as they are known
    Array<uint32_t> shares_;  // 16 / number of neighbours, in units of 2^-16
    Array<uint32_t> past_;
    Array<uint32_t> bases_;  // three fifths of what the past predicts
    Array<uint8_t> now_, classes_;
    Array<size_t> starts_;  // of the places that have each place as a neighbour
    Array<int32_t> followers_;
    uint32_t trust_ = 5;  // fifths: the weight of the neighbours, all of it in a first column, then two
    uint64_t seen_ = 0, expected_ = 0, ratio_ = kFirstRatio;
};

struct FieldModels {
    Model zero[kClasses];
    Model more[kClasses][kUnary];
    EscapeModels escape;
};

template <class Coder>
int64_t code_nonzero(Coder& coder, FieldModels& models, int context, int64_t value) {
    const uint64_t size = static_cast<uint64_t>(value < 0 ? -value : value);
    uint64_t read = 1;
    while (read < kUnary && coder.bit(models.more[context][read], size > read)) ++read;
    if (read == kUnary) {
        Coder apart = coder;  // whose address may be taken: the other one stays in registers
        read += code_escape(apart, models.escape, size - kUnary);
        coder = apart;
    }
    const bool negative = coder.raw_bit(value < 0);
    return negative ? -static_cast<int64_t>(read) : static_cast<int64_t>(read);
}

// Source of the encoder's symbols.
struct Given {
    const int32_t* symbols;
    size_t count;
    int64_t at(size_t c, size_t v) const { return symbols[c * count + v]; }
    void set(size_t, size_t, int64_t) const {}
};

// Destination of the decoder's.
struct Found {
    FieldTable table;
    double step;
    int64_t at(size_t, size_t) const { return 0; }
    void set(size_t c, size_t v, int64_t value) const {
        table.numbers[v * table.stride + c] = step * static_cast<double>(value);
    }
};

// All columns through a coder, either way; false where the bytes are bad.
template <class Coder, class Symbols>
bool code_field(Coder coder, const mr_weights& weights, const Symbols symbols, size_t* ends) {
    Magnitudes magnitudes(weights);
    FieldModels models;
    for (size_t c = 0; c < weights.columns; ++c) {
        for (size_t first = 0; first < weights.count; first += kBlock) {
            const size_t places = std::min(kBlock, weights.count - first);
            magnitudes.begin_block(first, places);
            const uint8_t* classes = magnitudes.classes();
            bool good = true;
            for (size_t v = first; v < first + places; ++v) {
                const int context = classes[v];
                const int64_t given = symbols.at(c, v);
                if (!coder.bit(models.zero[context], given != 0)) continue;
                const int64_t value = code_nonzero(coder, models, context, given);
                good = good && fits(value);
                symbols.set(c, v, value);
                magnitudes.learn(v, value);
            }
            if (coder.failed() || !good) return false;
            magnitudes.end_block(places);
        }
        magnitudes.next_column();
        if (ends) ends[c] = coder.position();
    }
    return coder.finish();
}

}  // namespace

bool decode_symbols(const mr_weights& shape, const mr_bytes& stream, double step, const FieldTable& table) {
    if (shape.count == 0 || shape.columns == 0) return stream.size == 0;
    return code_field(RangeDecoder(stream.data, stream.size), shape, Found{table, step}, nullptr);
}

}  // namespace meshreel

using namespace meshreel;

int mr_encode_field(const mr_weights* weights, uint8_t* out, size_t capacity, size_t* size, size_t* ends) {
    if (!is_causal(*weights)) return MR_NOT_CAUSAL;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<uint8_t> bytes;
        RangeEncoder coder(bytes);
        if (weights->count * weights->columns > 0)
            code_field(coder, *weights, Given{weights->symbols, weights->count}, ends);
        *size = bytes.size();
        return copy_out(bytes, out, capacity);
    });
}
