// The first layer of a group of form LAYERS: the motion of its base mesh, over the hierarchy of that mesh.
#include "input.h"

using namespace meshreel;

namespace {

Bytes record_of(Input& in, const Mesh& base, size_t frames) {
    Bytes record{2, static_cast<uint8_t>(in.u8() % 2), static_cast<uint8_t>(frames), in.u8()};
    record.resize(record.size() + 8);  // step: Python's to check
    put_blob(record, in.bytes());
    const uint8_t shared = in.u8() % 3;
    record.push_back(shared);
    mr_hierarchy* hierarchy = nullptr;
    const mr_mesh mesh = base.view();
    if (mr_hierarchy_create(&mesh, &hierarchy) != MR_OK) return record;
    put_field(in, mr_hierarchy_graph(hierarchy), 3 * frames, shared > 0 ? 1 + 3 * shared * frames : 0, record);
    mr_hierarchy_destroy(hierarchy);
    const uint8_t damage = in.u8();
    if (damage == 255) record[in.u16() % record.size()] ^= in.u8();
    if (damage == 254) record.resize(in.u16() % record.size());
    return record;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh base = mesh_of(in);
    const size_t frames = 1 + in.u8() % 12;
    const Bytes record = record_of(in, base, frames);
    const mr_bytes bytes{record.data(), record.size()};
    const mr_mesh mesh = base.view();
    std::vector<double> rows(3 * frames * base.vertices()), again(rows.size());
    const int status = mr_decode_motion(&bytes, &mesh, frames, rows.data());
    LAW(mr_decode_motion(&bytes, &mesh, frames, again.data()) == status);
    if (status != MR_OK) return 0;
    LAW(are_same(rows, again));
    for (double x : rows) LAW(std::isfinite(x));
    return 0;
}
