// Fields of records in turn (FORMAT.md, "Kinds of fields"), little-endian. All of them throw FormatError where bytes
// end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
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

    // Names the field that is read next, for what is thrown.
    void begin(const char* field) { field_ = field; }
    // Throws a FormatError with the name of the field.
    [[noreturn]] void refuse(const std::string& what) const;

    uint8_t u8() { return take(1)[0]; }
    uint16_t u16() { return static_cast<uint16_t>(number(2)); }
    uint32_t u32() { return static_cast<uint32_t>(number(4)); }
    int64_t i64() { return static_cast<int64_t>(number(8)); }
    double f32();  // finite
    double f64();  // finite
    uint64_t varint();
    // An enumeration's value from `first` to `last`.
    template <class Values>
    Values choice(Values first, Values last) {
        const uint8_t value = u8();
        if (value < static_cast<uint8_t>(first) || value > static_cast<uint8_t>(last))
            refuse(std::to_string(value) + " is none of the known values");
        return static_cast<Values>(value);
    }
    // A number of values that take `least` bytes each, at least.
    size_t count(uint64_t number, size_t least) const;

    const uint8_t* take(uint64_t size);
    mr_bytes blob(uint64_t size) { return {take(size), static_cast<size_t>(size)}; }
    mr_bytes rest() { return blob(left_); }
    std::string text(uint64_t size);

private:
    uint64_t number(int bytes);

    const uint8_t *begin_, *at_;
    size_t left_;
    const char* field_ = "record";
};

// The record that fills `data` exactly. Throws FormatError.
template <class Record>
Record read_all(const mr_bytes& data, const char* name) {
    Records in(data);
    Record record = Record::read(in);
    in.finish(name);
    return record;
}

// `count` integers, of which `data` is exactly the stream. Throws FormatError.
std::vector<int32_t> decode_integers(const mr_bytes& data, uint64_t count);
// Throws FormatError where `size` bytes cannot hold so many symbols.
void check_plausible(uint64_t count, size_t size);

constexpr unsigned kRungs = 200;  // of the ladder of steps (src/meshreel/coding/steps.py)
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
