#include "draco_reader.h"

#include <algorithm>

namespace meshreel {
namespace {

constexpr uint8_t kTagged = 0, kRaw = 1;
constexpr uint8_t kMostBits = 18;                 // of untagged symbols
constexpr uint64_t kMostValues = 1 << kMostBits;  // of theirs
constexpr uint64_t kFewValues = 64;               // of tables whose symbols are decoded: tags, and small symbols
constexpr uint64_t kMostTags = 33;                // numbers of bits of 32-bit numbers
constexpr int kTagPrecision = 12;

int precision_of(int bits) { return std::clamp(3 * bits / 2, 12, 20); }

// rANS (J. Duda), which is read from the last byte to the first.
template <class Value>
class Rans {
public:
    // `chances` of the values: their sum is 2^precision, or nothing can be decoded.
    Rans(int precision, const std::vector<uint32_t>& chances, const uint8_t* data, uint64_t size)
        : data_(data), precision_(precision), low_(4u << precision), chance_(chances), value_(size_t{1} << precision) {
        uint32_t sum = 0;
        for (size_t value = 0; value < chances.size(); ++value) {
            if (chances[value] > value_.size() - sum) return;
            below_.push_back(sum);
            std::fill_n(value_.begin() + sum, chances[value], static_cast<Value>(value));
            sum += chances[value];
        }
        const uint64_t bytes = size > 0 ? uint64_t{data[size - 1]} / 64 + 1 : 1;
        if (sum != value_.size() || bytes > size) return;
        left_ = size - bytes;
        for (uint64_t b = bytes; b > 0; --b) state_ = state_ << 8 | data[left_ + b - 1];
        state_ = (state_ & (~0u >> (34 - 8 * bytes))) + low_;
        good_ = state_ < 256 * low_;
    }

    bool good() const { return good_; }

    Value next() {
        while (state_ < low_ && left_ > 0) state_ = state_ << 8 | data_[--left_];
        const uint32_t place = state_ & ((1u << precision_) - 1);
        const Value value = value_[place];
        state_ = (state_ >> precision_) * chance_[value] + place - below_[value];
        return value;
    }

private:
    const uint8_t* data_;
    uint64_t left_ = 0;
    int precision_;
    uint32_t low_, state_ = 0;
    std::vector<uint32_t> chance_, below_;
    std::vector<Value> value_;
    bool good_ = false;
};

// Chances of at most `values` values: a byte or up to three for each, or a byte for up to 64 without any. Those of the
// first `kept` are returned.
std::vector<uint32_t> read_chances(DracoReader& in, uint64_t values, uint64_t kept = kFewValues) {
    const uint64_t count = in.varint();
    if (count > values) in.fail();
    std::vector<uint32_t> chances;
    for (uint64_t k = 0; k < count && in.good();) {
        const uint8_t first = in.byte();
        const int more = first & 3;
        uint32_t chance = more == 3 ? 0 : first >> 2;
        for (int b = 0; b < more && more < 3; ++b) chance |= static_cast<uint32_t>(in.byte()) << (8 * b + 6);
        const uint64_t end = k + (more == 3 ? first >> 2 : 0) + 1;
        if (end > count) in.fail();
        for (k = end; chances.size() < std::min(end, kept);) chances.push_back(chance);
    }
    return chances;
}

}  // namespace

const uint8_t* DracoReader::take(uint64_t count) {
    if (count > left_) fail();
    if (!good_) return nullptr;
    const uint8_t* taken = data_;
    data_ += count, left_ -= count;
    return taken;
}

uint8_t DracoReader::byte() {
    const uint8_t* taken = take(1);
    return taken ? *taken : 0;
}

uint64_t DracoReader::varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 63; shift += 7) {
        const uint8_t next = byte();
        value |= static_cast<uint64_t>(next & 0x7f) << shift;
        if (next < 0x80) return good_ ? value : 0;
    }
    fail();
    return 0;
}

uint32_t DracoReader::bits(int count) {
    uint32_t value = 0;
    for (int b = 0; b < count; ++b) {
        if (rest_count_ == 0) rest_ = byte(), rest_count_ = 8;
        value |= static_cast<uint32_t>(rest_ & 1) << b;
        rest_ >>= 1, --rest_count_;
    }
    return value;
}

DracoReader DracoReader::block() {
    const uint64_t size = varint();
    const uint8_t* data = take(size);
    return data ? DracoReader(data, size) : DracoReader();
}

void DracoReader::symbols(uint64_t count, uint64_t together, uint64_t values, std::vector<uint8_t>* out) {
    const uint8_t coding = byte();
    const int bits = coding == kRaw ? byte() : 0;
    if (coding > kRaw || (coding == kRaw && (bits < 1 || bits > kMostBits))) return fail();
    uint64_t tags = 1;  // numbers of bits: 0, 1 ...
    while ((values - 1) >> (tags - 1) > 0) ++tags;
    const std::vector<uint32_t> chances = read_chances(*this, coding == kRaw ? std::min(values, kMostValues) : tags);
    DracoReader block = this->block();
    if (coding == kRaw && !out) return;
    const uint64_t size = block.left_;
    const int precision = coding == kRaw ? precision_of(bits) : kTagPrecision;
    Rans<uint8_t> coded(precision, chances, block.data_, size);
    if (!good_ || !coded.good()) return fail();
    if (coding == kRaw)
        for (uint64_t k = 0; k < count; ++k) out->push_back(coded.next());
    else if (out)
        for (uint64_t k = 0; k < count && good_; ++k) out->push_back(static_cast<uint8_t>(this->bits(coded.next())));
    else {
        uint64_t sum = 0;
        for (uint64_t k = 0; k < count; ++k) sum += coded.next();
        take((sum * together + 7) / 8);
    }
    rest_count_ = 0;
}

std::vector<uint32_t> DracoReader::numbers(uint64_t count, uint64_t together) {
    const uint8_t coding = byte();
    const int bits = coding == kRaw ? byte() : 0;
    if (coding > kRaw || (coding == kRaw && (bits < 1 || bits > kMostBits))) fail();
    const uint64_t most = coding == kRaw ? kMostValues : kMostTags;
    const std::vector<uint32_t> chances = read_chances(*this, most, most);
    const DracoReader block = this->block();
    Rans<uint32_t> coded(coding == kRaw ? precision_of(bits) : kTagPrecision, chances, block.data_, block.left_);
    std::vector<uint32_t> found;
    if (!good_ || !coded.good()) return fail(), found;
    found.reserve(count * together);
    for (uint64_t k = 0; k < count && good_; ++k) {
        const int size = coding == kTagged ? static_cast<int>(coded.next()) : 0;
        for (uint64_t j = 0; j < together; ++j) found.push_back(coding == kRaw ? coded.next() : this->bits(size));
    }
    rest_count_ = 0;
    return found;
}

}  // namespace meshreel
