// Reads the parts of a Draco mesh that tell what decoding it will cost (bytes: Draco's bitstream specification, 2.2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace meshreel {

// Reads zeros behind the end, and is no longer good then. It does not become good again.
class DracoReader {
public:
    DracoReader() : DracoReader(nullptr, 0) {}
    DracoReader(const uint8_t* data, uint64_t size) : data_(data), left_(size) {}

    bool good() const { return good_; }
    bool at_end() const { return good_ && left_ == 0; }
    void fail() { good_ = false; }
    uint64_t left() const { return left_; }

    // The next bytes, null where there are not so many.
    const uint8_t* take(uint64_t count);
    uint8_t byte();
    uint64_t varint();  // below 2^63
    // A number of `count` bits of the bytes that follow, the low ones first.
    uint32_t bits(int count);
    // The bytes that follow a number of them.
    DracoReader block();

    // `count` groups of `together` symbols below `values`; they are stored unless `out` is null.
    void symbols(uint64_t count, uint64_t together, uint64_t values, std::vector<uint8_t>* out);
    // The same of symbols below 2^32, all of which are stored.
    std::vector<uint32_t> numbers(uint64_t count, uint64_t together);

    static constexpr uint64_t kAnyValue = uint64_t{1} << 32;

private:
    const uint8_t* data_;
    uint64_t left_;
    uint8_t rest_ = 0;  // bits of the last byte that bits() has left
    int rest_count_ = 0;
    bool good_ = true;
};

}  // namespace meshreel
