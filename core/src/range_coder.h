// The binary adaptive range coder: 32-bit range with carry, probabilities that learn at two speeds.
//
// RangeEncoder and RangeDecoder have the same face, so one template codes a value both ways: bit(model, b) takes the
// true bit when encoding, ignores it when decoding, and returns the bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace meshreel {

constexpr uint32_t kTop = 1u << 24;    // the range never stays below
constexpr uint32_t kSlowMemory = 300;  // symbols: weights are not stationary over a mesh, so a model forgets,
constexpr uint32_t kFastMemory =
    18;  // and averages a patient and a hasty estimate (1 to 3 % less than the patient one)

constexpr std::array<uint32_t, kSlowMemory + 1> learning_rates() {
    std::array<uint32_t, kSlowMemory + 1> rates{};
    for (uint32_t n = 0; n <= kSlowMemory; ++n)
        rates[n] = 65536 / (n + 2);  // Krichevsky-Trofimov, until the memory is full
    return rates;
}
inline constexpr auto kRates = learning_rates();

struct Model {  // slow and fast are not neighbours: a compiler that makes one vector of them waits for memory on its
                // way back
    uint32_t slow = 1u << 31;         // probability of a 1, in units of 2^-32
    uint32_t probability = 1u << 15;  // the mean of both, in units of 2^-16, never 0 or 1
    uint32_t fast = 1u << 31;
    uint32_t seen = 0;

    void update(bool bit) { bit ? update_one() : update_zero(); }
    void update_one() {
        learn([](uint32_t one, uint32_t rate) {
            return one + static_cast<uint32_t>((static_cast<uint64_t>(~one) * rate) >> 16);
        });
    }
    void update_zero() {
        learn([](uint32_t one, uint32_t rate) {
            return one - static_cast<uint32_t>((static_cast<uint64_t>(one) * rate) >> 16);
        });
    }

private:
    template <class Moved>
    void learn(Moved moved) {
        uint32_t patient, hasty;
        if (seen == kSlowMemory) {  // nearly always, and then the rates are constants
            patient = moved(slow, kRates[kSlowMemory]);
            hasty = moved(fast, kRates[kFastMemory]);
        } else {
            patient = moved(slow, kRates[seen]);
            hasty = moved(fast, kRates[seen < kFastMemory ? seen : kFastMemory]);
            ++seen;
        }
        const uint32_t p = (patient >> 17) + (hasty >> 17);
        slow = patient;
        fast = hasty;
        probability = p < 16 ? 16 : p > 65520 ? 65520 : p;
    }
};

inline uint32_t bound_of(uint32_t range, uint32_t probability) {
    return static_cast<uint32_t>((static_cast<uint64_t>(range) * probability) >> 16);
}

// The shortest tail that pins the interval [low, low + range): every number that begins with it lies inside.
struct Tail {
    uint64_t value;  // in the 32-bit window, the carry on top
    int bytes;
};
inline Tail shortest_tail(uint32_t low, uint32_t range) {
    for (int bytes = 1;; ++bytes) {  // ends at 2: the range is at least 2^24
        const uint64_t block = 1ull << (32 - 8 * bytes);
        const uint64_t value = (low + block - 1) & ~(block - 1);
        if (value + block <= static_cast<uint64_t>(low) + range) return {value, bytes};
    }
}

class RangeEncoder {
public:
    explicit RangeEncoder(std::vector<uint8_t>& out) : out_(&out), begin_(out.size()) {}

    bool bit(Model& model, bool value) {
        const bool coded = code(model.probability, value);
        model.update(value);
        return coded;
    }
    bool raw_bit(bool value) { return code(1u << 15, value); }
    bool failed() const { return false; }
    size_t position() const { return out_->size() - begin_; }  // bytes, those that are still to come left out

    bool finish() {
        const Tail tail = shortest_tail(low_, range_);
        if (tail.value >> 32) carry();
        for (int k = 0; k < tail.bytes; ++k) out_->push_back(static_cast<uint8_t>(tail.value >> (24 - 8 * k)));
        return true;
    }

private:
    bool code(uint32_t probability, bool value) {
        const uint32_t bound = bound_of(range_, probability);
        if (value) {
            range_ = bound;
        } else {
            const uint32_t before = low_;
            low_ += bound;
            range_ -= bound;
            if (low_ < before) carry();
        }
        while (range_ < kTop) {
            out_->push_back(static_cast<uint8_t>(low_ >> 24));
            low_ <<= 8;
            range_ <<= 8;
        }
        return value;
    }
    void carry() {
        for (size_t k = out_->size(); k > begin_ && ++(*out_)[k - 1] == 0; --k) {
        }
    }

    std::vector<uint8_t>* out_;
    size_t begin_;
    uint32_t low_ = 0;
    uint32_t range_ = 0xFFFFFFFFu;
};

class RangeDecoder {
public:
    RangeDecoder(const uint8_t* data, size_t size) : data_(data), size_(size) {
        for (int k = 0; k < 4; ++k) code_ = code_ << 8 | next();
    }

    bool bit(Model& model, bool) {
        const uint32_t bound = bound_of(range_, model.probability);
        if (code_ < bound) {
            range_ = bound;
            model.update_one();
            fill();
            return true;
        }
        code_ -= bound;
        range_ -= bound;
        model.update_zero();
        fill();
        return false;
    }
    bool raw_bit(bool) {  // no branch: the bit is random, so a branch would be mispredicted
        const uint32_t half = range_ >> 1;
        const uint32_t low = code_ >= half;
        code_ -= half & (0u - low);
        range_ = half + (range_ & low);
        fill();
        return low == 0;
    }
    size_t position() const { return position_; }
    bool failed() const { return position_ > size_ + 3; }  // a whole stream is read at most 3 bytes past its end

    // True where the stream is exactly what the encoder writes for the symbols decoded: no byte missing, none left
    // over.
    bool finish() const {
        uint32_t window = 0;
        for (size_t k = position_ - 4; k < position_; ++k) window = window << 8 | (k < size_ ? data_[k] : 0u);
        const Tail tail = shortest_tail(window - code_, range_);
        return static_cast<uint32_t>(tail.value) == window && size_ == position_ - 4 + static_cast<size_t>(tail.bytes);
    }

private:
    void fill() {
        while (range_ < kTop) {
            code_ = code_ << 8 | next();
            range_ <<= 8;
        }
    }
    uint32_t next() {
        const uint32_t byte = position_ < size_ ? data_[position_] : 0u;
        ++position_;
        return byte;
    }

    const uint8_t* data_;
    size_t size_;
    size_t position_ = 0;
    uint32_t code_ = 0;  // the stream's number less the interval's low end
    uint32_t range_ = 0xFFFFFFFFu;
};

}  // namespace meshreel
