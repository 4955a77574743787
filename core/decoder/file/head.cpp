#include "head.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "../budget.h"

namespace meshreel {
namespace {

constexpr size_t kFlagsAt = 9, kChecksum = 4;

Header read_header(Records& in) {
    Header header = Header::read(in);
    for (const std::array<double, 3>& triple : {header.origin, header.minimum, header.maximum})
        for (const double value : triple) require(std::fabs(value) <= kLargest, "Header: a number that is too large");
    for (const double value : {header.frame_rate, header.scale})
        require(value >= kSmallest && value <= kLargest, "Header: a rate or a scale that is out of range");
    require(header.first_time >= -kExact, "Header.first_time: beyond 53 bits");
    for (int k = 0; k < 3; ++k) require(header.minimum[k] <= header.maximum[k], "Header: a minimum above its maximum");
    return header;
}

void read_times(Head& head) {
    const std::vector<uint64_t>& intervals = head.header.intervals;
    require(head.header.first_time <= kExact, "Header.first_time: beyond 53 bits");
    if (intervals.empty()) return;
    require(intervals.size() == head.frames - 1, "Header.intervals: not one between each two frames");
    head.times.assign(1, head.header.first_time);
    for (const uint64_t interval : intervals) {
        const int64_t last = head.times.back();
        require(interval > 0 && static_cast<int64_t>(interval) <= kExact - last,
                "Header.intervals: one that is 0, or a time beyond 53 bits");
        head.times.push_back(last + static_cast<int64_t>(interval));
    }
}

}  // namespace

uint64_t Chunk::size() const {
    uint64_t sum = 0;
    for (const Layer& layer : layers) sum += layer.size;
    return sum;
}

uint32_t head_size(const std::vector<uint8_t>& start, uint64_t file_size) {
    require(start.size() >= kPreambleSize && std::memcmp(start.data(), kMagic, sizeof kMagic) == 0,
            "not a .reel file: the signature is missing");
    Records in({start.data() + sizeof kMagic, kPreambleSize - sizeof kMagic});
    const int version = in.u8();
    if (version != kVersion)
        throw FormatError("format version " + std::to_string(version) + ": this reader knows version " +
                          std::to_string(kVersion) + ", update meshreel");
    require((in.u8() & ~kEdited) == 0, "flags that this reader does not know, update meshreel");
    const uint32_t size = in.u32();
    require(size >= kPreambleSize + kChecksum && size <= file_size, "the head is truncated or damaged");
    require(size <= limits::kHead, "a head of more bytes than it may have");
    return size;
}

Head parse_head(const std::vector<uint8_t>& data, uint64_t file_size) {
    const size_t end = data.size() - kChecksum;
    Records checksum({data.data() + end, kChecksum});
    const bool is_right = checksum.u32() == crc32(data.data(), end);
    require(is_right || kIgnoresChecksums, "the head is damaged: its checksum does not match");
    Records in({data.data() + kPreambleSize, end - kPreambleSize});
    Head head;
    head.header = read_header(in);
    in.begin("Index.chunks");
    const size_t count = in.count(in.u32(), 8);
    uint64_t offset = data.size();
    for (size_t number = 0; number < count; ++number) {
        head.chunks.emplace_back();
        Chunk& chunk = head.chunks.back();
        static_cast<IndexEntry&>(chunk) = IndexEntry::read(in);
        chunk.offset = offset;
        for (const Layer& layer : chunk.layers) {
            require(layer.size <= kExact - offset, "Index: chunks of more bytes than 53 bits count");
            offset += layer.size;
        }
    }
    in.finish("Index");
    head.size = offset;
    check_index(head);
    members_of(head.header.metadata);  // is one JSON object, whether or not an edit is read from it
    head.edit.ends = {0, head.frames};
    if (data[kFlagsAt] & kEdited) head.edit = parse_edit(head.header.metadata, head.frames);
    check_shown(head);
    head.frames = 0;
    for (size_t k = 0; k < head.edit.ends.size(); k += 2) head.frames += head.edit.ends[k + 1] - head.edit.ends[k];
    read_times(head);
    double frames = 0;
    for (const Chunk& chunk : head.chunks) frames += chunk.kind == ChunkKind::GROUP ? chunk.frames : 0;
    require(frames <= limits::kFrames + limits::kFramesPerByte * static_cast<double>(head.size),
            "more frames than so many bytes may have");
    require(file_size <= head.size, "bytes behind the last chunk, copy the file again");
    return head;
}

uint64_t Head::coded(uint64_t frame) const {
    const std::vector<uint64_t>& ends = edit.ends;
    uint64_t coded = ends[0] + frame;
    for (size_t k = 2; k < ends.size() && coded >= ends[k - 1]; k += 2) coded += ends[k] - ends[k - 1];
    return coded;
}

uint32_t Head::companion_of(uint32_t chunk, ChunkKind kind) const {
    const auto found = companions.find({chunk, kind});
    return found == companions.end() ? kNoChunk : found->second;
}

uint32_t Head::chunk_of_frame(uint64_t frame, size_t track) const {
    const std::vector<uint32_t>& groups = tracks[track];
    const auto behind = std::upper_bound(groups.begin(), groups.end(), frame, [&](uint64_t wanted, uint32_t number) {
        return wanted < chunks[number].first_frame;
    });
    return *(behind - 1);
}

uint32_t Head::static_of_frame(uint64_t frame) const {
    uint32_t newest = kNoChunk;
    for (size_t track = 0; track < tracks.size(); ++track)
        for (const uint64_t number : chunks[chunk_of_frame(frame, track)].depends_on)
            if (is_static(number) && (newest == kNoChunk || number > newest)) newest = static_cast<uint32_t>(number);
    return newest;
}

uint32_t Head::group_before(uint32_t chunk) const {
    for (const uint64_t number : chunks[chunk].depends_on)
        if (!is_static(number)) return static_cast<uint32_t>(number);
    return kNoChunk;
}

double Head::time_of(uint64_t frame) const {
    if (!times.empty()) return static_cast<double>(times[frame]) / 1e6;
    return static_cast<double>(header.first_time) / 1e6 + static_cast<double>(frame) / header.frame_rate;
}

std::string describe(const Head& head, uint32_t number) {
    const Chunk& chunk = head.chunks[number];
    const std::string name = "chunk " + std::to_string(number);
    if (chunk.frames == 0) return name + " (static)";
    const std::string track = head.tracks.size() == 1 ? "" : "track " + std::to_string(chunk.track) + ", ";
    int64_t first = static_cast<int64_t>(chunk.first_frame) - static_cast<int64_t>(head.edit.ends[0]);
    for (size_t k = 2; k < head.edit.ends.size() && chunk.first_frame >= head.edit.ends[k - 1]; k += 2)
        first -= static_cast<int64_t>(head.edit.ends[k] - head.edit.ends[k - 1]);
    return name + " (" + track + "frames " + std::to_string(first) + " to " + std::to_string(first + chunk.frames - 1) +
           ")";
}

}  // namespace meshreel
