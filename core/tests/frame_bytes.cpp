// Writes what the decoder makes of a .reel file, so that machines can be compared: frame_bytes FILE FRAMES PARTS SPLATS
// FRAMES: whole frames with all layers, then with one beyond the first: counts of vertices and faces, positions, faces.
// PARTS: of each track and of the background: counts, colours, places in textures.
// SPLATS: their numbers; some come of sines, in which libraries of mathematics differ.
#include <cstdio>
#include <memory>
#include <vector>

#include "meshreel/decoder.h"

namespace {

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

template <typename T>
void put(const File& file, const T* values, uint64_t count) {
    if (values) std::fwrite(values, sizeof(T), static_cast<size_t>(count), file.get());
}

bool write_frame(meshreel_video* video, uint64_t frame, const meshreel_info& info, const File& frames,
                 const File& parts, const File& out) {
    meshreel_mesh mesh;
    if (meshreel_decode(video, frame, MESHREEL_WHOLE, &mesh) != MESHREEL_OK) return false;
    put(frames, &mesh.vertex_count, 1);
    put(frames, &mesh.face_count, 1);
    put(frames, mesh.positions, 3 * mesh.vertex_count);
    put(frames, mesh.faces, 3 * mesh.face_count);
    for (int32_t part = MESHREEL_BACKGROUND; part < static_cast<int32_t>(info.tracks); ++part) {
        if (part == MESHREEL_WHOLE) continue;
        if (meshreel_decode(video, frame, part, &mesh) != MESHREEL_OK) return false;
        put(parts, &mesh.vertex_count, 1);
        put(parts, &mesh.face_count, 1);
        put(parts, mesh.colors, 3 * mesh.vertex_count);
        put(parts, mesh.uv, 6 * mesh.face_count);
        meshreel_splats splats;
        if (part < 0 || meshreel_decode_splats(video, frame, part, &splats) != MESHREEL_OK) continue;
        put(out, splats.means, 3 * splats.count);
        put(out, splats.axes, 9 * splats.count);
        put(out, splats.scales, 3 * splats.count);
        put(out, splats.opacities, splats.count);
        put(out, splats.colors, 3 * splats.count);
    }
    return true;
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 5) return std::fprintf(stderr, "frame_bytes FILE FRAMES PARTS SPLATS\n"), 2;
    const File file(std::fopen(arguments[1], "rb"), std::fclose);
    const File frames(std::fopen(arguments[2], "wb"), std::fclose), parts(std::fopen(arguments[3], "wb"), std::fclose);
    const File splats(std::fopen(arguments[4], "wb"), std::fclose);
    if (!file || !frames || !parts || !splats) return std::fprintf(stderr, "%s: cannot be opened\n", arguments[1]), 1;
    std::vector<uint8_t> bytes;
    for (int byte = std::fgetc(file.get()); byte != EOF; byte = std::fgetc(file.get()))
        bytes.push_back(static_cast<uint8_t>(byte));
    meshreel_video* opened = nullptr;
    meshreel_info info;
    bool good = meshreel_open_memory(bytes.data(), bytes.size(), &opened) == MESHREEL_OK &&
                meshreel_get_info(opened, &info) == MESHREEL_OK;
    for (const int32_t layers : {static_cast<int32_t>(good ? info.layers : 0), 1}) {
        good = good && meshreel_set_layers(opened, layers) == MESHREEL_OK;
        for (uint64_t frame = 0; good && frame < info.frames; ++frame)
            good = write_frame(opened, frame, info, frames, parts, splats);
    }
    if (!good) std::fprintf(stderr, "%s\n", meshreel_last_error(opened));
    meshreel_close(opened);
    return good ? 0 : 1;
}
