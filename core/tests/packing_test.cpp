#include "../wasm/packing.h"

#include <utility>

#include "check.h"
#include "shapes.h"

namespace {

std::vector<uint16_t> packed(const Shape& shape, int& status) {
    double box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
    mr_grow_box(shape.positions.data(), shape.vertices(), box);
    std::vector<uint16_t> texels(4 * shape.vertices());
    const mr_mesh mesh = shape.view();
    status = mr_pack_vertices(&mesh, box, texels.data());
    return texels;
}

}  // namespace

TEST(corners_of_the_box_are_the_ends_of_the_range_and_normals_point_up) {
    int status = MR_NO_MEMORY;
    const std::vector<uint16_t> texels = packed(sheet(3), status);
    CHECK(status == MR_OK);
    CHECK(texels[0] == 0 && texels[1] == 0 && texels[2] == 0 && texels[4] == 32768);
    CHECK(texels[32] == 65535 && texels[33] == 65535);
    for (size_t v = 0; v < 9; ++v) CHECK(texels[4 * v + 3] == (128 | 128 << 8));
}

TEST(normals_that_point_down_are_folded_outwards) {
    Shape shape = sheet(2);
    for (size_t f = 0; f < 2; ++f) std::swap(shape.faces[3 * f], shape.faces[3 * f + 1]);
    int status = MR_NO_MEMORY;
    CHECK(packed(shape, status)[3] == (255 | 255 << 8));
}

TEST(places_so_large_that_their_differences_overflow_are_packed_too) {
    Shape shape = sheet(2, 0.5);
    for (double& x : shape.positions) x = (x - 0.5) * 1e308 * 3;
    int status = MR_NO_MEMORY;
    for (uint16_t texel : packed(shape, status)) CHECK(texel <= 65535);
    CHECK(status == MR_OK);
    shape.faces[0] = 4;
    packed(shape, status);
    CHECK(status == MR_BAD_INPUT);
}
