// The decoder of files on damaged ones; tests/decoder/test_c_abi.py has what whole ones decode to. Checksums are
// ignored here, and sanitizers watch.
#include "meshreel/decoder.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "check.h"

namespace {

using File = std::vector<uint8_t>;

const char* const kFiles[] = {
    "cut",   "draco", "empty",       "laplacian",     "layers",           "layers_open",      "layers_patched",
    "mixed", "scene", "audio/audio", "colored/scene", "colored/textures", "colored/vertices", "splats/splats"};

File load(const std::string& name) {
    std::ifstream file(CONFORMANCE + name + ".reel", std::ios::binary);
    return File(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

// Reads every number of what is shown, so that a sanitizer sees what is not there.
double sum_of(const meshreel_mesh& mesh) {
    double sum = 0;
    for (uint64_t k = 0; k < 3 * mesh.vertex_count; ++k) sum += mesh.positions[k];
    for (uint64_t k = 0; k < 3 * mesh.vertex_count && mesh.colors; ++k) sum += mesh.colors[k];
    for (uint64_t k = 0; k < 6 * mesh.face_count && mesh.uv; ++k)
        sum += mesh.uv[k] == mesh.uv[k] ? mesh.uv[k] : 0;  // NaN: a face without a place
    return sum;
}

bool are_in_range(const meshreel_mesh& mesh) {
    return std::all_of(mesh.faces, mesh.faces + 3 * mesh.face_count,
                       [&](int32_t v) { return v >= 0 && static_cast<uint64_t>(v) < mesh.vertex_count; });
}

struct Tally {
    int opened = 0, decoded = 0, refused = 0;
};

void decode_frame(meshreel_video* video, uint64_t frame, int32_t part, Tally& tally) {
    meshreel_mesh mesh;
    const int32_t status = meshreel_decode(video, frame, part, &mesh);
    CHECK(status == MESHREEL_OK || std::strlen(meshreel_last_error(video)) > 0);
    CHECK(status == MESHREEL_OK || (mesh.vertex_count == 0 && mesh.positions == nullptr));
    if (status == MESHREEL_OK) CHECK(are_in_range(mesh) && sum_of(mesh) > -1e300);
    ++(status == MESHREEL_OK ? tally.decoded : tally.refused);
    meshreel_packet packet;
    meshreel_splats splats;
    if (meshreel_decode_splats(video, frame, part, &splats) == MESHREEL_OK && splats.count > 0)
        CHECK(splats.opacities[splats.count - 1] <= 1 && splats.colors[3 * splats.count - 1] <= 1);
    if (part != MESHREEL_WHOLE) meshreel_picture(video, frame, part, MESHREEL_AV1, &packet);
}

// Decodes some frames of a file, forward and backward, in all parts, from all layers and from few.
void decode(const File& file, std::mt19937& random, Tally& tally) {
    meshreel_video* video = nullptr;
    meshreel_info info;
    if (meshreel_open_memory(file.data(), file.size(), &video) == MESHREEL_OK &&
        meshreel_get_info(video, &info) == MESHREEL_OK) {
        ++tally.opened;
        const int32_t tracks = static_cast<int32_t>(std::min(info.tracks, 3u));
        for (int k = 0; k < 10; ++k) {
            if (k == 7) meshreel_set_layers(video, static_cast<int32_t>(random() % 3));
            decode_frame(video, random() % info.frames, static_cast<int32_t>(random() % (tracks + 2)) - 2, tally);
        }
    }
    meshreel_close(video);
}

constexpr int32_t kTracks = 6;
constexpr uint8_t kFrames = 3;  // of draco.reel

// Index entry of a group of one layer: kind, form, frames, track, dependencies, layers. Checksums are ignored.
File entry_of(uint8_t frames, uint8_t track, size_t size) {
    File entry = {2, 3, frames, 0, track, 0, 1, 0};
    for (; size > 127; size >>= 7) entry.push_back(static_cast<uint8_t>(size | 0x80));
    entry.push_back(static_cast<uint8_t>(size));
    entry.insert(entry.end(), 4, 0);
    return entry;
}

// The only group of a file, subdivided more often, as a group of each of so many tracks.
File with_tracks(const File& one, int32_t tracks, uint8_t levels) {
    uint32_t head = 0;
    std::memcpy(&head, one.data() + 10, sizeof head);
    File payload(one.begin() + head, one.end());
    payload[1] = levels;
    const size_t before = head - 4 - entry_of(kFrames, 0, payload.size()).size();  // the entry is the last of the head
    File file(one.begin(), one.begin() + static_cast<ptrdiff_t>(before));
    file[before - 4] = static_cast<uint8_t>(tracks);
    for (int32_t track = 0; track < tracks; ++track) {
        const File entry = entry_of(kFrames, static_cast<uint8_t>(track), payload.size());
        file.insert(file.end(), entry.begin(), entry.end());
    }
    const uint32_t size = static_cast<uint32_t>(file.size()) + 4;
    std::memcpy(file.data() + 10, &size, sizeof size);
    file.insert(file.end(), 4, 0);
    for (int32_t track = 0; track < tracks; ++track) file.insert(file.end(), payload.begin(), payload.end());
    return file;
}

}  // namespace

TEST(whole_golden_files_decode) {
    std::mt19937 random(1);
    for (const char* name : kFiles) {
        Tally tally;
        const File file = load(name);
        CHECK(file.size() > 0);
        decode(file, random, tally);
        CHECK(tally.opened == 1 && tally.refused == 0);
    }
}

TEST(changed_bytes_are_refused_or_decode_to_a_mesh) {
    constexpr int kTries = 100;  // of each file
    std::mt19937 random(2);
    Tally tally;
    for (const char* name : kFiles) {
        const File whole = load(name);
        for (int k = 0; k < kTries; ++k) {
            File file = whole;
            for (uint32_t changes = 1 + random() % 3; changes > 0; --changes) {
                uint8_t& byte = file[random() % file.size()];
                byte = random() % 2 ? byte ^ static_cast<uint8_t>(1u << random() % 8) : static_cast<uint8_t>(random());
            }
            decode(file, random, tally);
        }
    }
    CHECK(tally.opened > 300 && tally.decoded > 1000 && tally.refused > 300);
}

TEST(every_truncation_of_a_head_is_refused_and_those_behind_it_leave_the_chunks_before) {
    std::mt19937 random(3);
    for (const char* name : kFiles) {
        const File whole = load(name);
        uint32_t head = 0;
        std::memcpy(&head, whole.data() + 10, sizeof head);
        Tally of_heads, behind;
        for (size_t size = 0; size < head; size += 1 + size / 50)
            decode(File(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(size)), random, of_heads);
        for (int k = 0; k < 20; ++k)
            decode(File(whole.begin(), whole.begin() + head + random() % (whole.size() - head)), random, behind);
        CHECK(of_heads.opened == 0 && behind.opened == 20);
    }
}

TEST(a_longer_file_and_one_of_another_version_are_refused_in_words) {
    File file = load("draco");
    file.push_back(0);
    meshreel_video* video = nullptr;
    CHECK(meshreel_open_memory(file.data(), file.size(), &video) == MESHREEL_DAMAGED);
    CHECK(std::strstr(meshreel_last_error(video), "behind the last chunk"));
    meshreel_close(video);
    file = load("draco");
    file[8] = 2;
    CHECK(meshreel_open_memory(file.data(), file.size(), &video) == MESHREEL_DAMAGED);
    CHECK(std::strstr(meshreel_last_error(video), "version 2"));
    meshreel_close(video);
}

TEST(of_many_tracks_the_newest_groups_are_kept_while_their_bytes_may_have_as_much) {
    constexpr uint8_t kLevels = 7;
    const File one = load("draco");
    for (const bool is_small : {true, false}) {
        const File file = with_tracks(one, kTracks, is_small ? uint8_t{0} : kLevels);
        meshreel_video* video = nullptr;
        meshreel_mesh mesh;
        CHECK(meshreel_open_memory(file.data(), file.size(), &video) == MESHREEL_OK);
        uint64_t identities[kTracks];
        const auto identity = [&](int32_t track) {
            CHECK(meshreel_decode(video, 0, track, &mesh) == MESHREEL_OK && mesh.vertex_count > 0);
            return mesh.identity;
        };
        for (int32_t track = 0; track < kTracks; ++track) identities[track] = identity(track);
        CHECK(identity(kTracks - 1) == identities[kTracks - 1] && identity(kTracks - 2) == identities[kTracks - 2]);
        CHECK((identity(0) == identities[0]) == is_small);
        const int32_t status = meshreel_decode(video, 0, MESHREEL_WHOLE, &mesh);
        CHECK(status == (is_small ? MESHREEL_OK : MESHREEL_DAMAGED));
        CHECK(is_small || std::strstr(meshreel_last_error(video), "more memory together"));
        meshreel_close(video);
    }
}

TEST(arguments_that_are_not_there_are_refused) {
    const File file = load("draco");
    meshreel_video* video = nullptr;
    meshreel_mesh mesh;
    CHECK(meshreel_open_memory(nullptr, 0, &video) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(video, 0, MESHREEL_WHOLE, &mesh) == MESHREEL_BAD_ARGUMENT);
    meshreel_close(video);
    CHECK(meshreel_open_memory(file.data(), file.size(), nullptr) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_open_memory(file.data(), file.size(), &video) == MESHREEL_OK);
    CHECK(meshreel_decode(video, 0, MESHREEL_WHOLE, nullptr) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(video, 3, MESHREEL_WHOLE, &mesh) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(video, 0, 1, &mesh) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(video, 0, -3, &mesh) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_set_layers(video, -2) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(nullptr, 0, 0, &mesh) == MESHREEL_BAD_ARGUMENT);
    CHECK(meshreel_decode(video, 0, MESHREEL_WHOLE, &mesh) == MESHREEL_OK && mesh.vertex_count > 0);
    meshreel_close(video);
    meshreel_close(nullptr);
}
