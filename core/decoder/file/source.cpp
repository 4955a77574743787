#include "source.h"

#include <algorithm>

#include "../../src/format_error.h"

namespace meshreel {
namespace {

void check_layer(const Head& head, uint32_t number, size_t layer, const uint8_t* data) {
    const Layer& known = head.chunks[number].layers[layer];
    if (kIgnoresChecksums) return;
    if (crc32(data, static_cast<size_t>(known.size)) == known.crc) return;
    throw FormatError("layer " + std::to_string(layer) + " is damaged, its checksum does not match");
}

void check_form(const Head& head, uint32_t number, uint8_t form) {
    require(static_cast<Form>(form) == head.chunks[number].form, "its form is not the one that the index says");
}

}  // namespace

std::vector<uint8_t> Source::bytes(uint64_t offset, uint64_t length) const {
    if (length > size_ || offset > size_ - length)
        throw SourceError("truncated, the file ends at byte " + std::to_string(size_));
    std::vector<uint8_t> found(static_cast<size_t>(length));
    if (length == 0) return found;
    const int64_t count = read_(context_, offset, length, found.data());
    if (count != static_cast<int64_t>(length))
        throw SourceError(std::to_string(length) + " bytes from byte " + std::to_string(offset) + " could not be read");
    return found;
}

std::vector<uint8_t> Source::chunk(const Head& head, uint32_t number, int64_t layers) const {
    const Chunk& chunk = head.chunks[number];
    const size_t count = layers == kAllLayers
                             ? chunk.layers.size()
                             : static_cast<size_t>(std::clamp<int64_t>(layers, 1, chunk.layers.size()));
    uint64_t size = 0;
    for (size_t layer = 0; layer < count; ++layer) size += chunk.layers[layer].size;
    const std::vector<uint8_t> found = bytes(chunk.offset, size);
    size_t at = 0;
    for (size_t layer = 0; layer < count; at += static_cast<size_t>(chunk.layers[layer++].size))
        check_layer(head, number, layer, found.data() + at);
    check_form(head, number, found[0]);
    return found;
}

std::vector<uint8_t> Source::layer(const Head& head, uint32_t number, size_t layer) const {
    const Chunk& chunk = head.chunks[number];
    uint64_t offset = chunk.offset;
    for (size_t before = 0; before < layer; ++before) offset += chunk.layers[before].size;
    const std::vector<uint8_t> found = bytes(offset, chunk.layers[layer].size);
    check_layer(head, number, layer, found.data());
    check_form(head, number, found[0]);
    return found;
}

Head read_head(const Source& source) {
    std::vector<uint8_t> data = source.bytes(0, std::min(kFirstRequest, source.size()));
    const uint32_t size = head_size(data, source.size());
    if (size > data.size()) {
        const std::vector<uint8_t> rest = source.bytes(data.size(), size - data.size());
        data.insert(data.end(), rest.begin(), rest.end());
    }
    data.resize(size);
    return parse_head(data, source.size());
}

}  // namespace meshreel
