// Colours of the vertices of a mesh with its levels, decoded twice.
#include "meshreel/colors.h"

#include "input.h"

using namespace meshreel;

namespace {

// A CodedField over the hierarchy of a mesh, and a ColorsLevel for each level; the vertices that there are then.
Bytes records_of(Input& in, const Mesh& base, int levels, size_t frames, size_t& vertices) {
    Bytes records;
    mr_hierarchy* hierarchy = nullptr;
    const mr_mesh mesh = base.view();
    if (mr_hierarchy_create(&mesh, &hierarchy) != MR_OK) return records;
    put_field(in, mr_hierarchy_graph(hierarchy), 3 * frames, false, records);
    mr_hierarchy_destroy(hierarchy);
    std::vector<int32_t> faces = base.faces;
    for (int level = 0; level < levels; ++level) {
        const size_t count = faces.size() / 3;
        std::vector<int32_t> edges(6 * count), finer(12 * count), near(3 * count);
        size_t edge_count = 0;
        if (mr_subdivide(faces.data(), count, vertices, edges.data(), finer.data(), &edge_count) != MR_OK) break;
        std::vector<int64_t> starts(edge_count + 1);
        if (mr_siblings(finer.data(), count, vertices, edge_count, starts.data(), near.data()) != MR_OK) break;
        records.push_back(in.u8());
        const std::vector<double> unused(near.size());
        put_field(in, {edge_count, starts.data(), near.data(), unused.data()}, 3 * frames, false, records);
        vertices += edge_count;
        faces = finer;
    }
    const uint8_t damage = in.u8();
    if (damage == 255) records[in.u16() % records.size()] ^= in.u8();
    if (damage == 254) records.resize(in.u16() % records.size());
    return records;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh base = mesh_of(in, 96);
    const size_t frames = 1 + in.u8() % 6;
    const int levels = in.u8() % 3;
    size_t vertices = base.vertices();
    const Bytes records = records_of(in, base, levels, frames, vertices);
    if (in.u8() == 255) vertices = in.u8();
    std::vector<double> before(3 * vertices), last(before.size()), again(before.size());
    const bool has_before = in.u8() % 2 == 1;
    for (double& value : before) value = 0.001 * in.i16();
    const mr_mesh mesh = base.view();
    const mr_bytes bytes{records.data(), records.size()};
    const mr_colored colored{&mesh, levels, vertices, frames, 1 / 64.0 * in.u8(), has_before ? before.data() : nullptr};
    Bytes colors(3 * frames * vertices), same(colors.size());
    const int status = mr_decode_colors(&colored, &bytes, colors.data(), last.data());
    LAW(mr_decode_colors(&colored, &bytes, same.data(), again.data()) == status);
    if (status == MR_OK) LAW(are_same(last, again) && colors == same);
    return 0;
}
