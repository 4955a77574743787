// Coded pictures and the audio file, handed out as they are. Beside src/meshreel/coding/appearance/pictures.py.
#include <algorithm>
#include <cmath>

#include "../../src/format_error.h"
#include "video.h"

namespace meshreel {
namespace {

// The packets lie in `data`.
Pictures read_pictures(const std::vector<uint8_t>& data, VideoCodec codec, size_t frames) {
    Pictures pictures = read_all<Pictures>(view(data), "Pictures");
    const size_t count = pictures.packets.size();
    require(pictures.form == Form::VIDEO && pictures.codec == codec, "pictures of another form or coding");
    for (const mr_bytes& packet : pictures.packets) require(packet.size > 0, "pictures: a packet without bytes");
    const bool is_right = frames > 0 ? count == frames && pictures.interval == 1
                                     : pictures.interval > 0 && count > 0 && count <= kLayerPictures;
    require(is_right, "pictures: not one for each frame, or more than a layer may have");
    return pictures;
}

}  // namespace

Picture Video::picture(uint64_t frame, uint32_t chunk, ChunkKind kind) {
    lacking.clear();
    while (chunk != kNoChunk &&
           head.chunks[chunk].form == Form::PATCH)  // what is left of a background keeps its pictures
        chunk = static_cast<uint32_t>(head.chunks[chunk].depends_on[0]);
    const uint32_t of = chunk == kNoChunk ? kNoChunk : head.companion_of(chunk, kind);
    if (of == kNoChunk) return Picture{};
    const Chunk& coded = head.chunks[of];
    const VideoCodec codec = kind == ChunkKind::PICTURES ? VideoCodec::AV1 : VideoCodec::H264;
    const uint32_t number = static_cast<uint32_t>(coded.depends_on[1]);
    const Layout& own = atlas(number);
    Picture found{{}, uint64_t{number} << 24 | static_cast<uint64_t>(kind) << 16, 0, own.width, own.height};
    size_t at, layer = 0;
    if (coded.frames > 0) {
        at = static_cast<size_t>(frame - coded.first_frame);
        found.number = frame - head.chunks[head.chunks[number].depends_on[0]].first_frame;
    } else {
        const auto shown_from = head.shown_from.find(chunk);
        if (shown_from == head.shown_from.end() || frame < shown_from->second) return Picture{};  // not shown yet
        const std::vector<uint8_t> first = source_.layer(head, of, 0);
        const uint64_t picture = (frame - shown_from->second) / read_pictures(first, codec, 0).interval;
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

Sound Video::audio() const {
    uint32_t chunk = 0;
    while (chunk < head.chunks.size() && head.chunks[chunk].kind != ChunkKind::AUDIO) ++chunk;
    if (chunk == head.chunks.size()) return Sound{};
    const std::vector<uint8_t> data = read(chunk, kAllLayers);
    const AudioFile file = read_all<AudioFile>(view(data), "AudioFile");
    require(
        file.form == Form::AUDIO_FILE && file.data.size > 0 && std::abs(static_cast<double>(file.start)) <= kLargest,
        "audio without a byte, or that begins beyond all times");
    return {{file.data.data, file.data.data + file.data.size},
            static_cast<double>(file.start - head.header.first_time) / 1e6,
            file.type};
}

}  // namespace meshreel
