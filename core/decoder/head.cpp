#include "head.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "budget.h"

namespace meshreel {
namespace {

constexpr uint8_t kMagic[8] = {0x52, 0x45, 0x45, 0x4c, 0x0d, 0x0a, 0x1a, 0x0a};
constexpr int kVersion = 1;
constexpr size_t kFlagsAt = 9;
constexpr uint8_t kEdited = 1;  // the only flag
constexpr size_t kPreamble = 14, kChecksum = 4;
constexpr double kLargest = 1e15, kSmallest = 1e-15;  // of the numbers in a header

void read_triple(Records& in, double (&out)[3], bool is_single) {
    for (double& value : out) {
        value = is_single ? in.f32() : in.f64();
        require(std::fabs(value) <= kLargest, "Header: a number that is too large");
    }
}

Header read_header(Records& in) {
    Header header;
    header.frame_rate = in.f64();
    read_triple(in, header.origin, false);
    header.scale = in.f64();
    read_triple(in, header.minimum, true);
    read_triple(in, header.maximum, true);
    const mr_bytes text = in.blob(in.u16());
    header.metadata.assign(text.data, text.data + text.size);
    header.first_time = in.i64();
    const uint64_t count = in.varint();
    require(count <= in.left(), "Header.intervals: more than there are bytes");
    for (uint64_t k = 0; k < count; ++k) header.intervals.push_back(in.varint());
    for (const double value : {header.frame_rate, header.scale})
        require(value >= kSmallest && value <= kLargest, "Header: a rate or a scale that is out of range");
    for (int k = 0; k < 3; ++k) require(header.minimum[k] <= header.maximum[k], "Header: a minimum above its maximum");
    return header;
}

Chunk read_entry(Records& in) {
    Chunk chunk;
    chunk.kind = in.u8(), chunk.form = in.u8(), chunk.frames = in.u16(), chunk.track = in.varint();
    chunk.depends_on.resize(in.u8());
    for (uint64_t& number : chunk.depends_on) number = in.varint();
    const size_t count = in.u16();
    require(5 * count <= in.left(), "Index: more layers than there are bytes");
    chunk.layers.resize(count);
    for (Layer& layer : chunk.layers) layer.size = in.varint(), layer.crc = in.u32();
    return chunk;
}

void read_times(Head& head) {
    const std::vector<uint64_t>& intervals = head.header.intervals;
    if (intervals.empty()) return;
    require(intervals.size() == head.frames - 1, "Header.intervals: not one between each two frames");
    head.times.assign(1, head.header.first_time);
    for (const uint64_t interval : intervals) {
        const int64_t last = head.times.back();
        require(interval > 0 && interval <= static_cast<uint64_t>(INT64_MAX) &&
                    last <= INT64_MAX - static_cast<int64_t>(interval),
                "Header.intervals: one that is 0, or beyond all times");
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
    require(start.size() >= kPreamble && std::memcmp(start.data(), kMagic, sizeof kMagic) == 0,
            "not a .reel file: the signature is missing");
    Records in({start.data() + sizeof kMagic, kPreamble - sizeof kMagic});
    const int version = in.u8();
    if (version != kVersion)
        throw FormatError("format version " + std::to_string(version) + ": this reader knows version " +
                          std::to_string(kVersion) + ", update meshreel");
    require((in.u8() & ~kEdited) == 0, "flags that this reader does not know, update meshreel");
    const uint32_t size = in.u32();
    require(size >= kPreamble + kChecksum && size <= file_size, "the head is truncated or damaged");
    require(size <= limits::kMostHead, "a head of more bytes than it may have");
    return size;
}

Head parse_head(const std::vector<uint8_t>& data, uint64_t file_size) {
    const size_t end = data.size() - kChecksum;
    Records checksum({data.data() + end, kChecksum});
    const bool is_right = checksum.u32() == crc32(data.data(), end);
    require(is_right || kIgnoresChecksums, "the head is damaged: its checksum does not match");
    Records in({data.data() + kPreamble, end - kPreamble});
    Head head;
    head.header = read_header(in);
    const uint32_t count = in.u32();
    require(count <= in.left() / 8, "Index: more chunks than there are bytes");
    uint64_t offset = data.size();
    for (uint32_t number = 0; number < count; ++number) {
        head.chunks.push_back(read_entry(in));
        Chunk& chunk = head.chunks.back();
        chunk.offset = offset;
        for (const Layer& layer : chunk.layers) {
            require(layer.size <= INT64_MAX - offset, "Index: chunks beyond all files");
            offset += layer.size;
        }
    }
    in.finish("Index");
    head.size = offset;
    check_index(head);
    members_of(head.header.metadata);  // is one JSON object, whether or not an edit is read from it
    head.edit.end = head.frames;
    if (data[kFlagsAt] & kEdited) head.edit = parse_edit(head.header.metadata, head.frames);
    head.frames = head.edit.end - head.edit.first;
    read_times(head);
    double frames = 0;
    for (const Chunk& chunk : head.chunks) frames += chunk.kind == kGroup ? chunk.frames : 0;
    require(frames <= limits::kFrames + limits::kFramesPerByte * static_cast<double>(head.size),
            "more frames than so many bytes may have");
    require(file_size <= head.size, "bytes behind the last chunk, copy the file again");
    return head;
}

uint32_t Head::companion_of(uint32_t chunk, uint8_t kind) const {
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
    const int64_t first = static_cast<int64_t>(chunk.first_frame) - static_cast<int64_t>(head.edit.first);
    return name + " (" + track + "frames " + std::to_string(first) + " to " + std::to_string(first + chunk.frames - 1) +
           ")";
}

}  // namespace meshreel
