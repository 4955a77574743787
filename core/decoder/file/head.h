// The head of a file, checked, and where everything else lies. Beside src/meshreel/container/reader.py.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../../src/format_error.h"
#include "../../src/layout.gen.h"
#include "../group.h"

namespace meshreel {

constexpr uint32_t kNoChunk = ~0u;

// What of the coded frames is shown, and how it is turned.
struct Edit {
    std::vector<uint64_t> ends;  // first and end of each range of coded frames that is shown, in order
    bool is_turned = false;
    double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // about the origin, row by row
};

struct Chunk : IndexEntry {
    uint64_t offset = 0, first_frame = 0;

    bool is_companion() const { return kind >= ChunkKind::COLORS && kind <= ChunkKind::SPLATS; }
    uint64_t size() const;
};

struct Head {
    Header header;
    Edit edit;
    std::vector<Chunk> chunks;
    std::vector<std::vector<uint32_t>> tracks;                      // numbers of the groups of each
    std::map<std::pair<uint32_t, ChunkKind>, uint32_t> companions;  // by coded chunk and kind
    std::map<uint32_t, uint64_t> shown_from;  // of each static chunk, the first frame that names it
    std::vector<int64_t> times;               // of all frames shown, microseconds; or empty
    uint64_t frames = 0;                      // shown
    uint64_t size = 0;                        // bytes of the whole file

    // The number that a frame shown has among the coded ones, by which chunks are found.
    uint64_t coded(uint64_t frame) const;
    uint32_t companion_of(uint32_t chunk, ChunkKind kind) const;
    uint32_t chunk_of_frame(uint64_t frame, size_t track) const;
    // The newest static chunk that a group of the frame names, or kNoChunk.
    uint32_t static_of_frame(uint64_t frame) const;
    uint32_t group_before(uint32_t chunk) const;
    double time_of(uint64_t frame) const;  // s, of a frame shown
    bool is_static(uint64_t chunk) const { return chunks[chunk].kind == ChunkKind::STATIC; }
};

// Bytes that the first request is for.
constexpr uint64_t kFirstRequest = 16384;

// The size of the head, from the first bytes of a file of `file_size`. Throws FormatError.
uint32_t head_size(const std::vector<uint8_t>& start, uint64_t file_size);
// `data` is the head and no more. Throws FormatError.
Head parse_head(const std::vector<uint8_t>& data, uint64_t file_size);

// A chunk in words: its number, and what frames it holds.
std::string describe(const Head& head, uint32_t chunk);

// The laws of an index, entry by entry. Throws FormatError where one is broken. Fills in tracks and companions, and the
// first frames of the chunks.
void check_index(Head& head);

// The members of a JSON object: the text of each value as it is written, by its name; of equal names the last counts.
// Throws FormatError for anything else, nested values among it.
std::map<std::string, std::string> members_of(const std::string& json);
// The value of a member of a JSON object if it is a string, else "".
std::string text_member(const std::string& json, const std::string& name);
// The numbers of a JSON array of numbers, as they are written. Throws FormatError for anything else.
std::vector<std::string> number_list(const std::string& json);
// A number of JSON; infinite where no double is as large.
double double_of(const std::string& number);

// The edit that the metadata of a file of so many coded frames tells of. Throws FormatError.
Edit parse_edit(const std::string& metadata, uint64_t frames);
// Throws FormatError where a group has frames of two ranges that are shown.
void check_shown(const Head& head);

}  // namespace meshreel
