// Displacements of form LAPLACIAN: anchors, the least squares (eq. 13) and the basis (eq. 9).
#include "input.h"
#include "meshreel/laplacian.h"

using namespace meshreel;

namespace {

std::vector<int32_t> anchors_of(Input& in, const Mesh& mesh) {
    const int64_t count = in.u8(), vertices = static_cast<int64_t>(mesh.vertices());
    std::vector<int32_t> anchors(mesh.vertices());
    if (in.u8() % 4 > 0) {
        const int64_t found = mr_farthest_anchors(mesh.faces.data(), static_cast<int64_t>(mesh.face_count()), vertices,
                                                  count, anchors.data());
        anchors.resize(found < 0 ? 0 : static_cast<size_t>(found));
        return anchors;
    }
    anchors.clear();  // as AnchorRule.SPREAD gives them
    const uint8_t stride = in.u8() % 8;
    for (int32_t v = in.u8() % 4; v < vertices; v += 1 + stride) anchors.push_back(v);
    if (in.u8() == 255) anchors.push_back(in.number());
    return anchors;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const Mesh base = mesh_of(in, 40);
    const std::vector<int32_t> anchors = anchors_of(in, base);
    const int64_t columns = in.u8() % 4, count = static_cast<int64_t>(anchors.size());
    const double anchor_weight = 1 + in.u8() % 255, step = in.scale();
    const size_t vertices = base.vertices();
    std::vector<double> deltas((vertices + anchors.size()) * static_cast<size_t>(columns));
    for (double& delta : deltas) delta = step * in.number();
    std::vector<double> weights(vertices * static_cast<size_t>(columns)), again(weights.size());
    const mr_mesh mesh = base.view();
    const int status =
        mr_laplacian_solve(&mesh, anchors.data(), count, anchor_weight, deltas.data(), columns, weights.data());
    mr_laplacian* system = nullptr;
    if (mr_laplacian_create(&mesh, anchors.data(), count, anchor_weight, &system) == MR_OK)
        LAW(mr_laplacian_inverse(system, deltas.data(), columns, again.data()) == status);
    mr_laplacian_destroy(system);
    if (status != MR_OK) return 0;
    LAW(are_same(weights, again));
    const int64_t width = 3 * (in.u8() % 5);
    std::vector<double> vectors(static_cast<size_t>(columns * width)), mean(static_cast<size_t>(width));
    for (double& x : vectors) x = std::ldexp(in.number(), -20);
    for (double& x : mean) x = std::ldexp(in.number(), -20);
    std::vector<double> field(vertices * mean.size());
    mr_klt_inverse(weights.data(), static_cast<int64_t>(vertices), columns, vectors.data(), mean.data(), width,
                   field.data());
    return 0;
}
