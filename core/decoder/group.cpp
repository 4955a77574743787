#include "group.h"

#include <algorithm>

#include "budget.h"
#include "draco_mesh.h"
#include "head.h"
#include "meshreel/draco.h"
#include "records.h"

namespace meshreel {
namespace {

struct IntraMesh {
    Mesh base, mesh;  // before and after its subdivisions
    unsigned levels;
};

std::vector<IntraMesh> decode_intra(const mr_bytes& data) {
    Records in(data);
    require(in.u8() == kDraco, "a payload of another form than DRACO");
    const unsigned levels = in.u8();
    const double step = in.f64();
    const size_t count = in.u16();
    require(4 * count <= in.left(), "DracoGroup: more meshes than there are bytes");
    std::vector<mr_bytes> coded;
    for (size_t k = 0; k < count; ++k) coded.push_back(in.blob(in.u32()));
    in.finish("DracoGroup");
    check_step(step);
    check(mr_check_draco(coded.data(), count), "damaged Draco data: ");  // of all together
    std::vector<IntraMesh> found(count);
    double shown = 0, largest = 0;
    for (size_t k = 0; k < count; ++k) {
        found[k].base = decode_draco(coded[k], step), found[k].levels = levels;
        check_growth(found[k].base, levels, count);
        const double elements = elements_of(found[k].base, levels);
        shown += elements, largest = std::max(largest, elements);
    }
    check_cost(limits::kFrame * count_of(count) + limits::kShown * shown + limits::kElement * largest, data.size);
    for (IntraMesh& one : found) one.mesh = subdivide_midpoint(one.base, levels);
    return found;
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
    require(made.group.frames == context.frames, "a group of other frames than the index says");
    return made;
}

Continued decode_empty(const mr_bytes& data, const Context& context) {
    require(data.size == 1, "EmptyGroup: bytes too many");
    Continued made;
    made.group.frames = context.frames;
    return made;
}

Background decode_change(const mr_bytes& data, const Mesh& before, const mr_placement& place) {
    Records in(data);
    in.u8();  // the form
    const double step = in.f64();
    const uint64_t runs = in.varint();
    const mr_bytes coded = in.blob(in.varint()), mesh = in.blob(in.varint());
    in.finish("StaticPatch");
    check_step(step);
    Background made;
    if (runs > 0 || coded.size > 0) {
        require(runs <= before.face_count() + 1, "background: more runs than faces");
        size_t used = 0;
        const std::vector<uint8_t> dropped = fill_runs(decode_integers(coded, runs), before.face_count(), used);
        require(used == runs && runs > 1, "background: runs of which none drops a face, or too many");
        made.mesh = without(before, dropped);
    } else {
        made.mesh = before;
    }
    Mesh added = decode_draco(mesh, step);
    check_growth(added, 0);
    check_cost(change_cost(before, added), data.size);
    made.added = {added, 0, 1, added.vertex_count()};
    place_all(place, added.vertices);
    append(made.mesh, added);
    check_growth(made.mesh, 0);
    return made;
}

}  // namespace

double State::memory() const {
    size_t numbers = base.size() + colors.size();
    for (const std::vector<double>& level : scalars) numbers += level.size();
    return 8 * count_of(numbers);
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
    mesh.vertices.assign(positions.begin() + t * size, positions.begin() + (t + 1) * size);
    if (!colors.empty()) mesh.colors.assign(colors.begin() + t * size, colors.begin() + (t + 1) * size);
    mesh.faces = faces, mesh.places = places;
    if (!dropped.empty()) {
        const uint8_t* gone = dropped.data() + t * count;
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
    switch (data.data[0]) {
        case kLayers: return decode_layers(data, context);
        case kLaplacian: return decode_laplacian(data, context);
        case kDraco: return decode_frames(data, context);
        case kEmpty: return decode_empty(data, context);
        default: throw FormatError("a group of a form that is not known");
    }
}

Mesh base_mesh(const mr_bytes& data) {
    if (data.data[0] == kLayers) return layers_base(data);
    if (data.data[0] == kLaplacian) return laplacian_base(data);
    const std::vector<IntraMesh> meshes = decode_intra(data);
    require(meshes.size() == 1, "background: not one mesh");
    return meshes[0].base;
}

Background decode_background(const mr_bytes& data, const Mesh* before, const mr_placement& place) {
    if (data.data[0] == kPatch) {
        require(before, "background: a patch of a state that is not at hand");
        return decode_change(data, *before, place);
    }
    std::vector<IntraMesh> meshes = decode_intra(data);
    require(meshes.size() == 1, "background: not one mesh");
    Background made;
    made.mesh = std::move(meshes[0].mesh);
    place_all(place, made.mesh.vertices);
    const size_t vertices = meshes[0].base.vertex_count();
    made.added = {std::move(meshes[0].base), 0, 1, vertices};
    return made;
}

}  // namespace meshreel
