// Prints what each frame of a .reel file has, and writes one of them as OBJ:
//   frames FILE [FRAME OUT.obj]
// The file is read by ranges, as an engine reads its assets.
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "meshreel/decoder.h"

namespace {

int64_t read_file(void* file, uint64_t offset, uint64_t length, uint8_t* out) {
    std::FILE* opened = static_cast<std::FILE*>(file);
    if (std::fseek(opened, static_cast<long>(offset), SEEK_SET) != 0) return -1;
    return static_cast<int64_t>(std::fread(out, 1, static_cast<size_t>(length), opened));
}

uint64_t size_of(std::FILE* file) {
    std::fseek(file, 0, SEEK_END);
    const long size = std::ftell(file);
    return size < 0 ? 0 : static_cast<uint64_t>(size);
}

bool write_obj(const meshreel_mesh& mesh, const meshreel_info& info, const char* path) {
    std::FILE* out = std::fopen(path, "w");
    if (!out) return false;
    std::vector<float> points(3 * mesh.vertex_count);
    meshreel_round(&mesh, info.origin, points.data());
    for (uint64_t v = 0; v < mesh.vertex_count; ++v) {
        std::fprintf(out, "v %.9g %.9g %.9g", points[3 * v], points[3 * v + 1], points[3 * v + 2]);
        for (int k = 0; k < 3 && mesh.colors; ++k) std::fprintf(out, " %.4g", mesh.colors[3 * v + k] / 255.0);
        std::fputc('\n', out);
    }
    for (uint64_t f = 0; f < mesh.face_count; ++f) {
        const int32_t* corners = mesh.faces + 3 * f;
        std::fprintf(out, "f %d %d %d\n", corners[0] + 1, corners[1] + 1, corners[2] + 1);
    }
    return std::fclose(out) == 0;
}

int fail(const meshreel_video* video) {
    std::fprintf(stderr, "%s\n", meshreel_last_error(video));
    return 1;
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 2 && count != 4) return std::fprintf(stderr, "frames FILE [FRAME OUT.obj]\n"), 2;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(arguments[1], "rb"), std::fclose);
    if (!file) return std::fprintf(stderr, "%s: cannot be opened\n", arguments[1]), 1;
    meshreel_video* opened = nullptr;
    const int32_t status = meshreel_open(read_file, file.get(), size_of(file.get()), &opened);
    const std::unique_ptr<meshreel_video, void (*)(meshreel_video*)> video(opened, meshreel_close);
    meshreel_info info;
    if (status != MESHREEL_OK || meshreel_get_info(opened, &info) != MESHREEL_OK) return fail(opened);
    const uint64_t wanted = count == 4 ? std::strtoull(arguments[2], nullptr, 10) : info.frames;
    for (uint64_t frame = 0; frame < info.frames; ++frame) {
        meshreel_mesh mesh;
        double seconds = 0;
        meshreel_time(opened, frame, &seconds);
        if (meshreel_decode(opened, frame, MESHREEL_WHOLE, &mesh) != MESHREEL_OK) return fail(opened);
        std::printf("frame %" PRIu64 " at %.3f s: %" PRIu64 " vertices, %" PRIu64 " faces%s\n", frame, seconds,
                    mesh.vertex_count, mesh.face_count, mesh.colors ? ", in colour" : "");
        if (frame == wanted && !write_obj(mesh, info, arguments[3]))
            return std::fprintf(stderr, "%s: cannot be written\n", arguments[3]), 1;
    }
    return 0;
}
