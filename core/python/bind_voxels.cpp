#include <memory>

#include "meshreel/voxels.h"
#include "trees.h"

namespace meshreel {
namespace {

using namespace nb::literals;

using Voxels =
    nb::ndarray<const float, nb::shape<-1, MR_BLOCK_SIDE, MR_BLOCK_SIDE, MR_BLOCK_SIDE>, nb::c_contig, nb::device::cpu>;
using OutVoxels =
    nb::ndarray<float, nb::shape<-1, MR_BLOCK_SIDE, MR_BLOCK_SIDE, MR_BLOCK_SIDE>, nb::c_contig, nb::device::cpu>;
using Blocks = nb::ndarray<const int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

mr_depth depth_of(const In<float, 2>& depths, const In<double, 2>& projection, const In<double, 2>& ways,
                  const In<double, 1>& eye) {
    expect(projection.shape(0) == 3 && projection.shape(1) == 4 && are_vectors(ways, 3) && eye.shape(0) == 3);
    return {depths.data(), depths.shape(0), depths.shape(1), projection.data(), ways.data(), eye.data()};
}

Out<int32_t, 2> touched_blocks(In<float, 2> depths, In<double, 2> projection, In<double, 2> ways, In<double, 1> eye,
                               double voxel, double reach) {
    const mr_depth picture = depth_of(depths, projection, ways, eye);
    mr_touched* touched = nullptr;
    const int32_t* blocks = nullptr;
    size_t count = 0;
    check(without_gil([&] { return mr_touched_create(&picture, voxel, reach, &touched, &blocks, &count); }));
    const std::unique_ptr<mr_touched, Destroy<mr_touched, mr_touched_destroy>> owner(touched);
    return Buffer<int32_t>(blocks, 3 * count).shaped(count, 3);
}

void integrate(In<float, 2> depths, In<double, 2> projection, In<double, 2> ways, In<double, 1> eye, double voxel,
               double reach, Blocks blocks, OutVoxels distances, OutVoxels weights) {
    const mr_depth picture = depth_of(depths, projection, ways, eye);
    const size_t count = blocks.shape(0);
    expect(distances.shape(0) == count && weights.shape(0) == count);
    const mr_blocks into{blocks.data(), count, voxel, distances.data(), weights.data()};
    check(without_gil([&] { return mr_integrate(&picture, reach, &into); }));
}

void point_distances(In<double, 2> points, In<double, 2> normals, double voxel, double radius, double past,
                     Blocks blocks, OutVoxels distances, OutVoxels weights) {
    const size_t count = blocks.shape(0), many = points.shape(0);
    expect(are_vectors(points, many) && are_vectors(normals, many));
    expect(distances.shape(0) == count && weights.shape(0) == count);
    const mr_oriented from{points.data(), normals.data(), many};
    const mr_blocks into{blocks.data(), count, voxel, distances.data(), weights.data()};
    check(without_gil([&] { return mr_point_distances(&from, radius, past, &into); }));
}

nb::tuple zero_level(Blocks blocks, Voxels distances, Voxels weights, double voxel, float least) {
    const size_t count = blocks.shape(0);
    expect(distances.shape(0) == count && weights.shape(0) == count);
    const mr_blocks of{blocks.data(), count, voxel, const_cast<float*>(distances.data()),
                       const_cast<float*>(weights.data())};
    mr_zero* zero = nullptr;
    mr_mesh mesh{};
    check(without_gil([&] { return mr_zero_create(&of, least, &zero, &mesh); }));
    const std::unique_ptr<mr_zero, Destroy<mr_zero, mr_zero_destroy>> owner(zero);
    return nb::make_tuple(Buffer<double>(mesh.positions, 3 * mesh.vertices).shaped(mesh.vertices, 3),
                          Buffer<int32_t>(mesh.faces, 3 * mesh.face_count).shaped(mesh.face_count, 3));
}

}  // namespace

void bind_voxels(nb::module_& m) {
    m.def("touched_blocks", &touched_blocks, "depths"_a, "projection"_a, "ways"_a, "eye"_a, "voxel"_a, "reach"_a,
          "The blocks of voxels near the surface in a depth picture, ascending.");
    m.def("integrate", &integrate, "depths"_a, "projection"_a, "ways"_a, "eye"_a, "voxel"_a, "reach"_a, "blocks"_a,
          "distances"_a.noconvert(), "weights"_a.noconvert(),
          "Takes a depth picture into `distances` and `weights` (in place).");
    m.def("point_distances", &point_distances, "points"_a, "normals"_a, "voxel"_a, "radius"_a, "past"_a, "blocks"_a,
          "distances"_a.noconvert(), "weights"_a.noconvert(),
          "Sets the distances of voxels near points with normals, and their weights (in place).");
    m.def("zero_level", &zero_level, "blocks"_a, "distances"_a, "weights"_a, "voxel"_a, "least"_a,
          "Positions and faces of the surface where distances are 0, by marching cubes.");
}

}  // namespace meshreel
