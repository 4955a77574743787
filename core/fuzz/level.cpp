// A further layer of a group of form LAYERS. As the last one it gives the frames that its rows would give.
#include "input.h"

using namespace meshreel;

namespace {

struct Finer {
    std::vector<int32_t> edges, faces, near;
    std::vector<int64_t> starts;
    size_t edge_count = 0;
};

bool subdivided(const Mesh& mesh, Finer& out) {
    const size_t count = mesh.face_count();
    out.edges.resize(6 * count);
    out.faces.resize(12 * count);
    if (mr_subdivide(mesh.faces.data(), count, mesh.vertices(), out.edges.data(), out.faces.data(), &out.edge_count))
        return false;
    out.starts.resize(out.edge_count + 1);
    out.near.resize(3 * count);
    LAW(mr_siblings(out.faces.data(), count, mesh.vertices(), out.edge_count, out.starts.data(), out.near.data()) ==
        MR_OK);
    return true;
}

Bytes record_of(Input& in, const Finer& finer, size_t frames) {
    Bytes record{static_cast<uint8_t>(in.u8() % 2), in.u8(), in.u8()};
    const std::vector<double> unused(finer.near.size());
    put_field(in, {finer.edge_count, finer.starts.data(), finer.near.data(), unused.data()}, frames, false, record);
    const uint8_t damage = in.u8();
    if (damage == 255) record[in.u16() % record.size()] ^= in.u8();
    if (damage == 254) record.resize(in.u16() % record.size());
    return record;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh mesh = mesh_of(in, 32);
    const size_t frames = in.u8() % 9;
    Finer finer;
    if (!subdivided(mesh, finer)) return 0;
    const Bytes record = record_of(in, finer, frames);
    const mr_bytes bytes{record.data(), record.size()};
    const size_t coarse = mesh.vertices(), count = coarse + finer.edge_count;
    std::vector<double> rows(3 * frames * count), previous(finer.edge_count), last(finer.edge_count), end(last.size());
    for (size_t v = 0; v < coarse; ++v)
        for (size_t k = 0; k < 3; ++k)
            for (size_t t = 0; t < frames; ++t)
                rows[(3 * v + k) * frames + t] = mesh.positions[3 * v + k] * (1.0 + 0.01 * static_cast<double>(t));
    const bool has_previous = in.u8() % 2 == 1;
    for (double& scalar : previous) scalar = 0.001 * in.i16();
    const mr_level level{frames,
                         coarse,
                         mesh.faces.data(),
                         mesh.face_count(),
                         finer.edges.data(),
                         finer.edge_count,
                         finer.starts.data(),
                         finer.near.data(),
                         has_previous ? previous.data() : nullptr};
    const std::vector<double> known(rows.begin(), rows.begin() + static_cast<int64_t>(3 * frames * coarse));
    std::vector<double> shown(rows.size()), wanted(rows.size());
    const mr_placement placement{in.scale(), {0.5, 1e6, -2.0}};
    const bool is_placed = in.u8() % 2 == 1;
    const mr_frames to{shown.data(), is_placed ? &placement : nullptr, nullptr},
        expected{wanted.data(), to.placement, nullptr};
    const int status = mr_decode_level(&bytes, &level, rows.data(), last.data());
    const int at_end = mr_decode_last_level(&bytes, &level, known.data(), end.data(), &to);
    std::vector<double> alone(last.size());
    LAW(mr_decode_last_scalars(&bytes, &level, alone.data()) == status);
    if (status == MR_OK) LAW(are_same(alone, last));
    LAW(at_end == status || (status == MR_OK && at_end == MR_NOT_FINITE));
    if (status != MR_OK) return 0;
    LAW(mr_frames_of_rows(rows.data(), frames, count, &expected) == at_end);
    LAW(are_same(last, end));
    if (at_end == MR_OK) LAW(are_same(shown, wanted));
    return 0;
}
