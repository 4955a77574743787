// Decoded frames as a graphics processor takes them, whatever finite numbers a file gave them.
#include "../wasm/packing.h"

#include "input.h"

using namespace meshreel;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    Mesh mesh = mesh_of(in, 64);
    const double stretch = in.scale();
    if (in.u8() % 2 == 1)
        for (double& x : mesh.positions) x = std::isfinite(x * stretch) ? x * stretch : x;
    double box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
    mr_grow_box(mesh.positions.data(), mesh.vertices(), box);
    for (size_t v = 0; v < mesh.vertices(); ++v)
        for (size_t k = 0; k < 3; ++k) {
            const double x = mesh.positions[3 * v + k];
            LAW(box[k] <= x && x <= box[3 + k]);
        }
    if (in.u8() == 255) box[in.u8() % 6] = in.scale();  // a box of another group
    std::vector<uint16_t> texels(4 * mesh.vertices());
    const mr_mesh view = mesh.view();
    mr_pack_vertices(&view, box, texels.data());
    return 0;
}
