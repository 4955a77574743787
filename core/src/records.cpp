#include "records.h"

#include <array>
#include <cmath>
#include <cstring>

#include "format_error.h"
#include "meshreel/entropy.h"

namespace meshreel {
namespace {

constexpr uint64_t kSymbolsPerByte = 22'800;  // no stream says more (src/meshreel/coding/entropy.py)

std::array<uint32_t, 256> crc_table() {
    std::array<uint32_t, 256> table{};
    for (uint32_t byte = 0; byte < 256; ++byte) {
        uint32_t rest = byte;
        for (int bit = 0; bit < 8; ++bit) rest = rest & 1 ? rest >> 1 ^ 0xEDB88320u : rest >> 1;
        table[byte] = rest;
    }
    return table;
}

}  // namespace

void Records::refuse(const std::string& what) const { throw FormatError(field_ + (": " + what)); }

const uint8_t* Records::take(uint64_t size) {
    if (size > left_)
        refuse(std::to_string(size) + " bytes needed at byte " + std::to_string(offset()) + ", " +
               std::to_string(left_) + " left");
    const uint8_t* from = at_;
    at_ += size, left_ -= static_cast<size_t>(size);
    return from;
}

void Records::finish(const char* what) const {
    if (left_ > 0) throw FormatError(std::string(what) + ": " + std::to_string(left_) + " bytes too many");
}

uint64_t Records::number(int bytes) {
    const uint8_t* from = take(static_cast<uint64_t>(bytes));
    uint64_t value = 0;
    for (int k = bytes - 1; k >= 0; --k) value = value << 8 | from[k];
    return value;
}

size_t Records::count(uint64_t number, size_t least) const {
    if (number > left_ / least)
        refuse(std::to_string(number) + " values of at least " + std::to_string(least) + " bytes, " +
               std::to_string(left_) + " bytes left");
    return static_cast<size_t>(number);
}

std::string Records::text(uint64_t size) {
    const mr_bytes bytes = blob(size);
    return std::string(bytes.data, bytes.data + bytes.size);
}

double Records::f32() {
    const uint32_t bits = u32();
    float value;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) refuse("a number that is not finite");
    return static_cast<double>(value);
}

double Records::f64() {
    const uint64_t bits = number(8);
    double value;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) refuse("a number that is not finite");
    return value;
}

uint64_t Records::varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 56; shift += 7) {
        const uint8_t byte = u8();
        if (shift == 49 && byte > 15) refuse("a varint beyond 53 bits or longer than it needs to be");
        value |= static_cast<uint64_t>(byte & 0x7F) << shift;
        if (byte & 0x80) continue;
        if (shift > 0 && byte == 0) refuse("a varint beyond 53 bits or longer than it needs to be");
        break;
    }
    return value;
}

std::vector<int32_t> decode_integers(const mr_bytes& data, uint64_t count) {
    check_plausible(count, data.size);
    std::vector<int32_t> values(static_cast<size_t>(count));
    check(mr_decode_integers(data.data, data.size, values.size(), values.data()), "integers: ");
    return values;
}

void check_plausible(uint64_t count, size_t size) {
    require(count <= kSymbolsPerByte * (uint64_t{size} + 4) && (count > 0) == (size > 0),
            "symbols that cannot come from so few bytes; the stream is damaged");
}

double step_of(unsigned level) {
    constexpr double kEighths[8] = {4294967296.0, 3938502376.0, 3611622603.0, 3311872529.0,
                                    3037000500.0, 2784941738.0, 2553802834.0, 2341847524.0};
    require(level < kRungs, "a step that the ladder does not have");
    return std::ldexp(kEighths[level % 8], -32 - static_cast<int>(level / 8));
}

uint32_t crc32(const uint8_t* data, size_t size) {
    static const std::array<uint32_t, 256> table = crc_table();
    uint32_t rest = ~0u;
    for (size_t k = 0; k < size; ++k) rest = rest >> 8 ^ table[(rest ^ data[k]) & 0xFF];
    return ~rest;
}

}  // namespace meshreel
