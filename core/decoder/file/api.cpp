// The C ABI of the decoder: nothing is thrown across it.
#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <new>

#include "../../src/format_error.h"
#include "meshreel/decoder.h"
#include "video.h"

using namespace meshreel;

struct meshreel_video {
    std::unique_ptr<Video> video;  // null where the file did not open
    std::string error;
    Mesh mesh;        // of the last call
    Picture picture;  // of the last call
    Sound sound;      // of the last call
    Bound splats;     // of the last call
    struct Known {
        std::weak_ptr<const std::vector<int32_t>> faces;  // of a group that may have been dropped
        uint64_t identity;
    };
    std::map<int32_t, Known> known;  // by part, what was handed out last
    uint64_t identities = 0;
};

namespace {

// A message must never be what fails.
void tell(meshreel_video& handle, const char* message) noexcept {
    try {
        handle.error = message;
    } catch (...) {
        handle.error.clear();
    }
}

// What `body` gives, its exceptions as statuses.
template <class Body>
int32_t guarded_call(meshreel_video& handle, Body body) {
    try {
        handle.error.clear();
        return body();
    } catch (const FormatError& error) {
        tell(handle, error.what());
        return MESHREEL_DAMAGED;
    } catch (const SourceError& error) {
        tell(handle, error.what());
        return MESHREEL_UNREADABLE;
    } catch (const std::exception&) {  // std::bad_alloc, or std::length_error
        tell(handle, "no memory");
        return MESHREEL_NO_MEMORY;
    }
}

int32_t refuse(meshreel_video& handle, const char* message) {
    tell(handle, message);
    return MESHREEL_BAD_ARGUMENT;
}

// The same of a call that needs an open file, and pointers that are not null.
template <class Body>
int32_t call(meshreel_video* handle, bool has_pointers, Body body) {
    if (!handle) return MESHREEL_BAD_ARGUMENT;
    return guarded_call(*handle, [&]() -> int32_t {
        if (!handle->video) return refuse(*handle, "the file did not open");
        if (!has_pointers) return refuse(*handle, "a null pointer");
        return body(*handle->video);
    });
}

int64_t read_memory(void* context, uint64_t offset, uint64_t length, uint8_t* out) {
    std::memcpy(out, static_cast<const uint8_t*>(context) + offset, static_cast<size_t>(length));
    return static_cast<int64_t>(length);
}

int32_t up_of(const std::string& metadata) {
    const std::string up = text_member(metadata, "up");
    if (up == "z") return MESHREEL_UP_Z;
    if (up == "-y") return MESHREEL_UP_MINUS_Y;
    return up == "-z" ? MESHREEL_UP_MINUS_Z : MESHREEL_UP_Y;
}

void count_chunks(const Head& head, meshreel_info& info) {
    for (const Chunk& chunk : head.chunks) {
        const uint32_t beyond = static_cast<uint32_t>(chunk.layers.size()) - 1;
        if (chunk.kind == ChunkKind::GROUP) info.layers = std::max(info.layers, beyond);
        if (chunk.kind == ChunkKind::GROUP)
            for (const uint64_t number : chunk.depends_on) info.has_background |= head.is_static(number);
        info.has_textures |= chunk.kind == ChunkKind::PICTURES || chunk.kind == ChunkKind::COMPATIBLE;
        info.has_splats |= chunk.kind == ChunkKind::SPLATS;
        info.has_colors |= chunk.kind == ChunkKind::COLORS;
    }
}

void describe_file(const Head& head, meshreel_info& info) {
    const Header& header = head.header;
    info = {};
    info.frames = head.frames, info.frame_rate = header.frame_rate, info.scale = header.scale;
    info.duration = head.time_of(head.frames - 1) - head.time_of(0) + 1 / header.frame_rate;
    info.tracks = static_cast<uint32_t>(head.tracks.size());
    info.up = up_of(header.metadata);
    for (int k = 0; k < 3; ++k) {
        double low = 0, high = 0;  // of the box when it is turned
        for (int j = 0; j < 3; ++j) {
            const double turn = header.scale * head.edit.rotation[3 * k + j];
            const auto ends = std::minmax({turn * header.minimum[j], turn * header.maximum[j]});
            low += ends.first, high += ends.second;
        }
        info.origin[k] = header.origin[k];
        info.minimum[k] = header.origin[k] + low;
        info.maximum[k] = header.origin[k] + high;
    }
    count_chunks(head, info);
}

const char* fault_of(const Head& head, uint64_t frame, int32_t part) {
    if (frame >= head.frames) return "a frame that the file does not have";
    const bool is_part = part >= MESHREEL_BACKGROUND && (part < 0 || static_cast<size_t>(part) < head.tracks.size());
    return is_part ? nullptr : "a part that the file does not have";
}

void show(meshreel_video& handle, int32_t part, meshreel_mesh& out) {
    const Mesh& mesh = handle.mesh;
    meshreel_video::Known& known = handle.known[part];
    if (known.faces.lock() != mesh.faces) known = {mesh.faces, ++handle.identities};
    out.vertex_count = mesh.vertex_count(), out.face_count = mesh.face_count();
    out.positions = mesh.vertices.data(), out.faces = mesh.faces->data();
    out.colors = mesh.colors.empty() ? nullptr : mesh.colors.data();
    out.uv = mesh.places.empty() ? nullptr : mesh.places.data();
    out.identity = known.identity;
}

}  // namespace

uint32_t meshreel_abi_version(void) { return MESHREEL_ABI_VERSION; }

int32_t meshreel_open(meshreel_read read, void* context, uint64_t size, meshreel_video** video) {
    if (!video) return MESHREEL_BAD_ARGUMENT;
    *video = new (std::nothrow) meshreel_video;
    if (!*video) return MESHREEL_NO_MEMORY;
    meshreel_video& handle = **video;
    return guarded_call(handle, [&]() -> int32_t {
        if (!read) return refuse(handle, "a null pointer");
        handle.video = std::make_unique<Video>(Source(read, context, size));
        return MESHREEL_OK;
    });
}

int32_t meshreel_open_memory(const uint8_t* data, uint64_t size, meshreel_video** video) {
    return meshreel_open(data ? read_memory : nullptr, const_cast<uint8_t*>(data), size, video);
}

void meshreel_close(meshreel_video* video) { delete video; }

const char* meshreel_last_error(const meshreel_video* video) { return video ? video->error.c_str() : "no memory"; }

int32_t meshreel_get_info(meshreel_video* video, meshreel_info* info) {
    return call(video, info, [&](const Video& opened) -> int32_t {
        describe_file(opened.head, *info);
        return MESHREEL_OK;
    });
}

int32_t meshreel_time(meshreel_video* video, uint64_t frame, double* seconds) {
    return call(video, seconds, [&](const Video& opened) -> int32_t {
        const char* fault = fault_of(opened.head, frame, MESHREEL_WHOLE);
        if (fault) return refuse(*video, fault);
        *seconds = opened.head.time_of(frame);
        return MESHREEL_OK;
    });
}

const char* meshreel_metadata(const meshreel_video* video) {
    return video && video->video ? video->video->head.header.metadata.c_str() : "";
}

int32_t meshreel_set_layers(meshreel_video* video, int32_t layers) {
    return call(video, true, [&](Video& opened) -> int32_t {
        if (layers < -1) return refuse(*video, "fewer layers than none: give -1 for all of them");
        opened.set_layers(layers);
        return MESHREEL_OK;
    });
}

int32_t meshreel_decode(meshreel_video* video, uint64_t frame, int32_t part, meshreel_mesh* mesh) {
    if (mesh) *mesh = {};
    return call(video, mesh, [&](Video& opened) -> int32_t {
        const char* fault = fault_of(opened.head, frame, part);
        if (fault) return refuse(*video, fault);
        const uint64_t coded = opened.head.coded(frame);
        video->mesh = Mesh();
        video->mesh = part == MESHREEL_WHOLE        ? opened.whole(coded)
                      : part == MESHREEL_BACKGROUND ? opened.background(coded)
                                                    : opened.track(coded, static_cast<size_t>(part));
        show(*video, part, *mesh);
        video->error = opened.lacking;
        return MESHREEL_OK;
    });
}

void meshreel_round(const meshreel_mesh* mesh, const double* about, float* out) {
    for (uint64_t k = 0; k < 3 * mesh->vertex_count; ++k)
        out[k] = static_cast<float>(mesh->positions[k] - (about ? about[k % 3] : 0.0));
}

int32_t meshreel_picture(meshreel_video* video, uint64_t frame, int32_t part, int32_t codec, meshreel_packet* packet) {
    if (packet) *packet = {};
    return call(video, packet, [&](Video& opened) -> int32_t {
        const char* fault = fault_of(opened.head, frame, part);
        if (fault || part == MESHREEL_WHOLE)
            return refuse(*video, fault ? fault : "a whole frame has several textures: name a part");
        if (codec != MESHREEL_AV1 && codec != MESHREEL_H264) return refuse(*video, "a coding that is not known");
        const Head& head = opened.head;
        const uint64_t coded = head.coded(frame);
        const uint32_t chunk = part == MESHREEL_BACKGROUND ? head.static_of_frame(coded)
                                                           : head.chunk_of_frame(coded, static_cast<size_t>(part));
        video->picture =
            opened.picture(coded, chunk, codec == MESHREEL_AV1 ? ChunkKind::PICTURES : ChunkKind::COMPATIBLE);
        const Picture& found = video->picture;
        if (found.packet.empty()) return MESHREEL_OK;
        *packet = {found.packet.data(), found.packet.size(), found.stream, found.number, found.width, found.height};
        return MESHREEL_OK;
    });
}

int32_t meshreel_audio(meshreel_video* video, meshreel_sound* sound) {
    if (sound) *sound = {};
    return call(video, sound, [&](const Video& opened) -> int32_t {
        video->sound = opened.audio();
        const Sound& found = video->sound;
        if (found.data.empty()) return MESHREEL_OK;
        *sound = {found.data.data(), found.data.size(), found.start, static_cast<int32_t>(found.type)};
        return MESHREEL_OK;
    });
}

int32_t meshreel_decode_splats(meshreel_video* video, uint64_t frame, int32_t track, meshreel_splats* splats) {
    if (splats) *splats = {};
    return call(video, splats, [&](Video& opened) -> int32_t {
        const char* fault = fault_of(opened.head, frame, track);
        if (fault || track < 0) return refuse(*video, fault ? fault : "splats belong to a track");
        video->splats = opened.splats(opened.head.coded(frame), static_cast<size_t>(track));
        const Bound& found = video->splats;
        *splats = {found.opacities.size(), found.means.data(),     found.axes.data(),
                   found.scales.data(),    found.opacities.data(), found.colors.data()};
        return MESHREEL_OK;
    });
}
