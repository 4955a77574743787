// Fields of records in turn (FORMAT.md, "Kinds of fields"), little-endian. All of them throw FormatError where bytes
// end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshreel/status.h"

namespace meshreel {

class Records {
public:
    explicit Records(const mr_bytes& bytes) : begin_(bytes.data), at_(bytes.data), left_(bytes.size) {}

    size_t left() const { return left_; }
    size_t offset() const { return static_cast<size_t>(at_ - begin_); }
    // What was read since an offset.
    mr_bytes since(size_t offset) const { return {begin_ + offset, this->offset() - offset}; }
    // Throws where bytes are left over.
    void finish(const char* what) const;

    uint8_t u8() { return take(1)[0]; }
    uint16_t u16() { return static_cast<uint16_t>(number(2)); }
    uint32_t u32() { return static_cast<uint32_t>(number(4)); }
    int64_t i64() { return static_cast<int64_t>(number(8)); }
    double f32();  // finite
    double f64();  // finite
    uint64_t varint();
    // An enumeration's value from `first` to `last`.
    uint8_t choice(uint8_t first, uint8_t last);

    const uint8_t* take(uint64_t size);
    mr_bytes blob(uint64_t size) { return {take(size), static_cast<size_t>(size)}; }
    mr_bytes rest() { return blob(left_); }

    void skip_field();         // a CodedField
    void skip_colors_level();  // a ColorsLevel

private:
    uint64_t number(int bytes);

    const uint8_t *begin_, *at_;
    size_t left_;
};

// `count` integers, of which `data` is exactly the stream. Throws FormatError.
std::vector<int32_t> decode_integers(const mr_bytes& data, uint64_t count);
// Throws FormatError where `size` bytes cannot hold so many symbols.
void check_plausible(uint64_t count, size_t size);

// 2^(-level / 8), the same number everywhere. Throws FormatError beyond the ladder.
double step_of(unsigned level);

// A build for tests that damage bytes, which are to reach what lies behind the checksums.
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
constexpr bool kIgnoresChecksums = true;
#else
constexpr bool kIgnoresChecksums = false;
#endif

// CRC-32 (ISO-HDLC, as in zlib).
uint32_t crc32(const uint8_t* data, size_t size);

}  // namespace meshreel
