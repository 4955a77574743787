#include "group.h"

#include <algorithm>

#include "../src/records.h"
#include "budget.h"
#include "draco_mesh.h"
#include "meshreel/draco.h"

namespace meshreel {
namespace {

// 0 for no bytes, which is no form.
Form form_of(const mr_bytes& data) { return static_cast<Form>(data.size > 0 ? data.data[0] : 0); }

struct IntraMesh {
    Mesh base, mesh;  // before and after its subdivisions
    unsigned levels;
};

std::vector<IntraMesh> decode_intra(const mr_bytes& data) {
    const DracoGroup record = read_all<DracoGroup>(data, "DracoGroup");
    const unsigned levels = record.levels;
    const std::vector<mr_bytes>& coded = record.meshes;
    const size_t count = coded.size();
    check_step(record.step);
    check(mr_check_draco(coded.data(), count), "damaged Draco data: ");  // of all together
    std::vector<IntraMesh> found(count);
    double shown = 0, largest = 0;
    for (size_t k = 0; k < count; ++k) {
        found[k].base = decode_draco(coded[k], record.step), found[k].levels = levels;
        check_growth(found[k].base, levels, count);
        const double elements = elements_of(found[k].base, levels);
        shown += elements, largest = std::max(largest, elements);
    }
    check_cost(limits::kFrame * count_of(count) + limits::kShown * shown + limits::kElement * largest, data.size);
    for (IntraMesh& one : found) one.mesh = subdivide_midpoint(one.base, levels);
    return found;
}

void need_one(size_t meshes) {
    if (meshes != 1) throw FormatError("background: " + std::to_string(meshes) + " meshes, a state has one");
}

Continued decode_frames(const mr_bytes& data, const Context& context) {
    Continued made;
    for (IntraMesh& one : decode_intra(data)) {
        const size_t vertices = one.mesh.vertex_count();
        place_all(context.place, one.mesh.vertices);
        made.group.added.push_back(std::move(one.mesh));
        if (vertices > 0) made.canvas.push_back({std::move(one.base), one.levels, 1, vertices});
    }
    made.group.frames = made.group.added.size();
    check_frames(made.group.frames, context);
    return made;
}

Continued decode_empty(const mr_bytes& data, const Context& context) {
    require(data.size == 1, "EmptyGroup: bytes too many");
    Continued made;
    made.group.frames = context.frames;
    return made;
}

Background decode_change(const mr_bytes& data, const Mesh& before, const mr_placement& place) {
    const StaticPatch record = read_all<StaticPatch>(data, "StaticPatch");
    const uint64_t runs = record.runs;
    check_step(record.step);
    Background made;
    if (runs > 0 || record.dropped.size > 0) {
        require(runs <= before.face_count() + 1, "background: more runs than faces");
        size_t used = 0;
        const std::vector<uint8_t> dropped =
            fill_runs(decode_integers(record.dropped, runs), before.face_count(), used);
        require(used == runs && runs > 1, "background: runs of which none drops a face, or too many");
        made.mesh = without(before, dropped);
    } else {
        made.mesh = before;
    }
    Mesh added = decode_draco(record.mesh, record.step);
    check_growth(added, 0);
    check_cost(change_cost(before, added), data.size);
    made.added = {added, 0, 1, added.vertex_count()};
    place_all(place, added.vertices);
    append(made.mesh, added);
    check_growth(made.mesh, 0);
    return made;
}

}  // namespace

void check_frames(size_t frames, const Context& context) {
    if (frames != context.frames)
        throw FormatError("a group of " + std::to_string(frames) + " frames where the index says " +
                          std::to_string(context.frames));
}

double State::memory_beyond(const State* before) const {
    size_t numbers = base.size() + colors.size(), indices = faces->size();
    for (const std::vector<double>& level : scalars) numbers += level.size();
    for (size_t k = 0; k < finer.size(); ++k) {
        const Connectivity& near = *finer[k];
        if (before && k < before->finer.size() && before->finer[k] == finer[k]) continue;
        indices += near.edges.size() + near.faces->size() + near.near.size(), numbers += near.starts.size();
    }
    return 8 * count_of(numbers) + 4 * count_of(indices);
}

double Group::memory() const {
    double bytes = 8 * count_of(positions.size()) + 4 * count_of(faces->size()) + count_of(colors.size());
    bytes += 12 * count_of(dropped.size());
    for (const Mesh& mesh : added)
        bytes += 8 * count_of(mesh.vertices.size()) + 4 * count_of(mesh.faces->size()) + count_of(mesh.colors.size());
    return bytes;
}

Mesh Group::frame(size_t t) const {
    Mesh mesh;
    const size_t size = 3 * vertices, corners = faces->size(), count = corners / 3;
    mesh.vertices.assign(positions.data() + t * size, positions.data() + (t + 1) * size);
    if (!colors.empty()) mesh.colors.assign(colors.begin() + t * size, colors.begin() + (t + 1) * size);
    mesh.faces = faces, mesh.places = places;
    if (const uint8_t* gone = dropped_in(t)) {
        std::vector<int32_t> kept(corners);
        kept.resize(3 * mr_keep_faces(faces->data(), gone, count, kept.data()));
        mesh.faces = std::make_shared<const std::vector<int32_t>>(std::move(kept));
        mesh.places.clear();
        for (size_t f = 0; f < count && !places.empty(); ++f)
            if (!gone[f]) mesh.places.insert(mesh.places.end(), places.begin() + 6 * f, places.begin() + 6 * f + 6);
    }
    if (!added.empty()) append(mesh, added[t]);
    return mesh;
}

Continued continue_group(const mr_bytes& data, const Context& context) {
    switch (form_of(data)) {
        case Form::LAYERS: return decode_layers(data, context);
        case Form::LAPLACIAN: return decode_laplacian(data, context);
        case Form::DRACO: return decode_frames(data, context);
        case Form::EMPTY: return decode_empty(data, context);
        default: throw FormatError("a group of a form that is not known");
    }
}

Mesh base_mesh(const mr_bytes& data) {
    if (form_of(data) == Form::LAYERS) return layers_base(data);
    if (form_of(data) == Form::LAPLACIAN) return laplacian_base(data);
    const std::vector<IntraMesh> meshes = decode_intra(data);
    need_one(meshes.size());
    return meshes[0].base;
}

Background decode_background(const mr_bytes& data, const Mesh* before, const mr_placement& place) {
    if (form_of(data) == Form::PATCH) {
        require(before, "background: a patch of a state that is not at hand");
        return decode_change(data, *before, place);
    }
    std::vector<IntraMesh> meshes = decode_intra(data);
    need_one(meshes.size());
    Background made;
    made.mesh = std::move(meshes[0].mesh);
    place_all(place, made.mesh.vertices);
    const size_t vertices = meshes[0].base.vertex_count();
    made.added = {std::move(meshes[0].base), 0, 1, vertices};
    return made;
}

}  // namespace meshreel
