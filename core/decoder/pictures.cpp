// Coded pictures, handed out as they are. Beside src/meshreel/coding/appearance/pictures.py.
#include <algorithm>

#include "format_error.h"
#include "video.h"

namespace meshreel {
namespace {

constexpr uint64_t kLayerPictures = 64;  // of a background, in each layer but the last

struct Pictures {
    uint64_t interval;
    std::vector<mr_bytes> packets;
};

Pictures read_pictures(const std::vector<uint8_t>& data, uint8_t codec, size_t frames) {
    Records in(view(data));
    require(in.u8() == kVideo && in.u8() == codec, "pictures of another form or coding");
    Pictures pictures;
    pictures.interval = in.varint();
    const size_t count = in.u16();
    require(count <= in.left(), "pictures: more packets than there are bytes");
    for (size_t k = 0; k < count; ++k) {
        pictures.packets.push_back(in.blob(in.varint()));
        require(pictures.packets.back().size > 0, "pictures: a packet without bytes");
    }
    in.finish("pictures");
    const bool is_right = frames > 0 ? count == frames && pictures.interval == 1
                                     : pictures.interval > 0 && count > 0 && count <= kLayerPictures;
    require(is_right, "pictures: not one for each frame, or more than a layer may have");
    return pictures;
}

}  // namespace

Picture Video::picture(uint64_t frame, uint32_t chunk, Kind kind) {
    lacking.clear();
    while (chunk != kNoChunk && head.chunks[chunk].form == kPatch)  // what is left of a background keeps its pictures
        chunk = static_cast<uint32_t>(head.chunks[chunk].depends_on[0]);
    const uint32_t of = chunk == kNoChunk ? kNoChunk : head.companion_of(chunk, kind);
    if (of == kNoChunk) return Picture{};
    const Chunk& coded = head.chunks[of];
    const uint8_t codec = kind == kPicturesOf ? MESHREEL_AV1 : MESHREEL_H264;
    const uint32_t number = static_cast<uint32_t>(coded.depends_on[1]);
    const Atlas& own = atlas(number);
    Picture found{{}, uint64_t{number} << 24 | uint64_t{kind} << 16, 0, own.width, own.height};
    size_t at, layer = 0;
    if (coded.frames > 0) {
        at = static_cast<size_t>(frame - coded.first_frame);
        found.number = frame - head.chunks[head.chunks[number].depends_on[0]].first_frame;
    } else {
        const auto shown_from = head.shown_from.find(chunk);
        if (shown_from == head.shown_from.end() || frame < shown_from->second) return Picture{};  // not shown yet
        const Pictures first = read_pictures(source_.layer(head, of, 0), codec, 0);
        const uint64_t picture = (frame - shown_from->second) / first.interval;
        layer = static_cast<size_t>(std::min<uint64_t>(picture / kLayerPictures, coded.layers.size() - 1));
        at = static_cast<size_t>(std::min(picture - layer * kLayerPictures, kLayerPictures - 1));
    }
    const std::vector<uint8_t> data = source_.layer(head, of, layer);
    const Pictures pictures = read_pictures(data, codec, coded.frames);
    if (coded.frames == 0) {
        require(layer + 1 == coded.layers.size() || pictures.packets.size() == kLayerPictures,
                "pictures: a layer of fewer than it has");
        at = std::min(at, pictures.packets.size() - 1);
        found.number = at, found.stream |= layer;
    }
    const mr_bytes& packet = pictures.packets[at];
    found.packet.assign(packet.data, packet.data + packet.size);
    return found;
}

}  // namespace meshreel
