// Connectivity: faces cut in four, siblings of edges, faces that remain.
#include <algorithm>

#include "input.h"

using namespace meshreel;

namespace {

void check_siblings(const std::vector<int64_t>& starts, const std::vector<int32_t>& near) {
    for (size_t e = 0; e + 1 < starts.size(); ++e)
        for (int64_t k = starts[e]; k < starts[e + 1]; ++k) {
            LAW(near[k] >= 0 && static_cast<size_t>(near[k]) < e);
            LAW(k == starts[e] || near[k - 1] < near[k]);
        }
}

void check_kept(Input& in, const Mesh& mesh) {
    const size_t count = mesh.face_count();
    Bytes dropped(count);
    size_t left = 0;
    for (uint8_t& is_dropped : dropped) is_dropped = in.u8() % 2, left += is_dropped == 0;
    std::vector<int32_t> kept(3 * count), wanted;
    LAW(mr_keep_faces(mesh.faces.data(), dropped.data(), count, kept.data()) == left);
    for (size_t f = 0; f < count; ++f)
        if (!dropped[f])
            for (size_t k = 0; k < 3; ++k) wanted.push_back(mesh.faces[3 * f + k]);
    LAW(std::equal(wanted.begin(), wanted.end(), kept.begin()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh mesh = mesh_of(in, 64);
    const size_t count = mesh.face_count(), vertices = in.u8() == 255 ? in.u32() | 1u << 31 : mesh.vertices();
    check_kept(in, mesh);
    std::vector<int32_t> edges(6 * count), finer(12 * count), near(3 * count);
    size_t edge_count = 0;
    if (mr_subdivide(mesh.faces.data(), count, vertices, edges.data(), finer.data(), &edge_count) != MR_OK) return 0;
    LAW(edge_count <= 3 * count);
    for (size_t e = 0; e < edge_count; ++e) LAW(edges[2 * e] <= edges[2 * e + 1]);
    for (int32_t corner : finer) LAW(corner >= 0 && static_cast<size_t>(corner) < vertices + edge_count);
    if (in.u8() == 255 && count > 0) finer[in.u16() % finer.size()] = in.number();
    std::vector<int64_t> starts(edge_count + 1);
    if (mr_siblings(finer.data(), count, vertices, edge_count, starts.data(), near.data()) == MR_OK)
        check_siblings(starts, near);
    return 0;
}
