// Faces that single frames are shown without, and small meshes that they are shown with. Beside
// src/meshreel/coding/layers/patches.py.
#include <cmath>

#include "../src/records.h"
#include "budget.h"
#include "draco_mesh.h"
#include "group.h"

namespace meshreel {
namespace {

constexpr double kMostCells = 1 << 20;  // of the lattice, over all frames

// frames x faces, 1 where a frame lacks a face; empty where nothing is dropped.
std::vector<uint8_t> decode_dropped(const std::vector<int32_t>& runs, size_t frames, size_t faces) {
    if (runs.empty()) return {};
    size_t used = 0;
    const std::vector<uint8_t> ever = fill_runs(runs, faces, used);
    std::vector<size_t> changing;
    for (size_t f = 0; f < faces; ++f)
        if (ever[f]) changing.push_back(f);
    const std::vector<uint8_t> turned = fill_runs(runs, frames * changing.size(), used);
    require(used == runs.size(), "patches: runs too many");
    std::vector<uint8_t> dropped(frames * faces);
    for (size_t k = 0; k < changing.size(); ++k) {
        uint8_t is_gone = 0;
        for (size_t t = 0; t < frames; ++t) {
            is_gone ^= turned[t * changing.size() + k];
            dropped[t * faces + changing[k]] = is_gone;
        }
    }
    return dropped;
}

// The mesh of each frame, out of one in which they lie side by side along x.
std::vector<Mesh> part(const Mesh& mesh, double width, double step, size_t frames) {
    const size_t count = mesh.vertex_count();
    std::vector<double> cells(3 * count), owners(count);
    bool fits = width > 0 && width * count_of(frames) <= kMostCells;
    for (size_t k = 0; k < cells.size(); ++k) {
        cells[k] = std::nearbyint(mesh.vertices[k] / step);
        fits = fits && std::fabs(cells[k]) <= 2 * kMostCells;
    }
    require(fits, "patches: more cells than they may have");
    for (size_t v = 0; v < count; ++v) {
        owners[v] = std::floor((cells[3 * v] + std::floor(width / 2)) / width);
        cells[3 * v] -= owners[v] * width;
    }
    std::vector<std::vector<int32_t>> faces(frames);
    for (size_t f = 0; f < mesh.face_count(); ++f) {
        const int32_t* corners = mesh.faces->data() + 3 * f;
        const double owner = owners[static_cast<size_t>(corners[0])];
        const bool is_whole = owner >= 0 && owner < count_of(frames) &&
                              owners[static_cast<size_t>(corners[1])] == owner &&
                              owners[static_cast<size_t>(corners[2])] == owner;
        require(is_whole, "patches: a face that is in no frame, or in two");
        std::vector<int32_t>& own = faces[static_cast<size_t>(owner)];
        own.insert(own.end(), corners, corners + 3);
    }
    // In the order of the vertices, each goes to the mesh of its frame; those of no face are left out.
    std::vector<int32_t> place(count, -1);
    for (const int32_t v : *mesh.faces) place[static_cast<size_t>(v)] = 0;
    std::vector<Mesh> parts(frames);
    for (size_t v = 0; v < count; ++v) {
        if (place[v] < 0) continue;
        Mesh& own = parts[static_cast<size_t>(owners[v])];
        place[v] = static_cast<int32_t>(own.vertex_count());
        for (size_t k = 0; k < 3; ++k) own.vertices.push_back(cells[3 * v + k] * step);
    }
    for (size_t t = 0; t < frames; ++t) {
        for (int32_t& v : faces[t]) v = place[static_cast<size_t>(v)];
        parts[t].faces = std::make_shared<const std::vector<int32_t>>(std::move(faces[t]));
    }
    return parts;
}

}  // namespace

void decode_patches(const mr_bytes& data, Group& group) {
    const LayersPatches record = read_all<LayersPatches>(data, "LayersPatches");
    const double step = step_of(record.step_level);
    const size_t faces = group.faces->size() / 3;
    require(record.runs <= 2 * faces + group.frames * (faces + 1) + 2, "patches: more runs than there are faces");
    group.dropped = decode_dropped(decode_integers(record.dropped, record.runs), group.frames, faces);
    const Mesh whole = decode_draco(record.mesh, step);
    group.added.resize(group.frames);
    if (whole.face_count() == 0) return;
    check_growth(whole, 0);
    group.added = part(whole, static_cast<double>(record.width), step, group.frames);
}

}  // namespace meshreel
