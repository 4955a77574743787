// Where the bytes of a file come from.
#pragma once

#include <cstdint>
#include <vector>

#include "head.h"
#include "meshreel/decoder.h"

namespace meshreel {

class Source {
public:
    Source(meshreel_read read, void* context, uint64_t size) : read_(read), context_(context), size_(size) {}

    uint64_t size() const { return size_; }
    // Throws SourceError where not all of these bytes are there.
    std::vector<uint8_t> bytes(uint64_t offset, uint64_t length) const;
    // The first `layers` layers of a chunk, or all of them for kAllLayers; their checksums and its form are right.
    // Throws FormatError as well.
    std::vector<uint8_t> chunk(const Head& head, uint32_t number, int64_t layers) const;
    // One layer, which is a payload of its own.
    std::vector<uint8_t> layer(const Head& head, uint32_t number, size_t layer) const;

private:
    meshreel_read read_;
    void* context_;
    uint64_t size_;
};

// The head of a file.
Head read_head(const Source& source);

inline mr_bytes view(const std::vector<uint8_t>& bytes) { return {bytes.data(), bytes.size()}; }

}  // namespace meshreel
