#include "arrays.h"
#include "meshreel/decimate.h"
#include "meshreel/topology.h"

namespace meshreel {
namespace {

// The vertices and faces that `take` leaves of a mesh.
template <class Take>
nb::tuple left_by(const mr_mesh& mesh, Take take) {
    Buffer<double> left(3 * mesh.vertices);
    Buffer<int32_t> kept(3 * mesh.face_count);
    mr_rest rest{left.data(), mesh.vertices, kept.data(), mesh.face_count};
    check(take(mesh, rest));
    if (rest.vertices < mesh.vertices) left = Buffer<double>(left.data(), 3 * rest.vertices);
    if (rest.face_count < mesh.face_count) kept = Buffer<int32_t>(kept.data(), 3 * rest.face_count);
    return nb::make_tuple(left.shaped(rest.vertices, 3), kept.shaped(rest.face_count, 3));
}

template <int (*take)(const mr_mesh*, mr_rest*)>
nb::tuple rest_of(In<double, 2> positions, In<int32_t, 2> faces) {
    return left_by(mesh_of(positions, faces), [](const mr_mesh& mesh, mr_rest& rest) { return take(&mesh, &rest); });
}

nb::tuple decimate(In<double, 2> positions, In<int32_t, 2> faces, size_t wanted, double border) {
    return left_by(mesh_of(positions, faces),
                   [&](const mr_mesh& mesh, mr_rest& rest) { return mr_decimate(&mesh, wanted, border, &rest); });
}

Out<int32_t, 1> components(In<int32_t, 2> faces, size_t vertices) {
    expect(faces.shape(1) == 3);
    Buffer<int32_t> labels(vertices);
    check(mr_components(faces.data(), faces.shape(0), vertices, labels.data()));
    return labels.shaped(vertices);
}

nb::tuple face_normals(In<double, 2> positions, In<int32_t, 2> faces) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<double> normals(3 * mesh.face_count), areas(mesh.face_count);
    check(mr_face_normals(&mesh, normals.data(), areas.data()));
    return nb::make_tuple(normals.shaped(mesh.face_count, 3), areas.shaped(mesh.face_count));
}

Out<double, 2> vertex_normals(In<double, 2> positions, In<int32_t, 2> faces) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<double> normals(3 * mesh.vertices);
    check(mr_vertex_normals(&mesh, normals.data()));
    return normals.shaped(mesh.vertices, 3);
}

nb::tuple spread(In<double, 2> positions, In<int32_t, 2> faces, double spacing, int32_t most) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<int32_t> parts(mesh.face_count);
    size_t count = 0;
    check(mr_spread_parts(&mesh, spacing, most, parts.data(), &count));
    Buffer<double> points(3 * count);
    Buffer<int64_t> of(count);
    check(mr_spread(&mesh, parts.data(), points.data(), of.data()));
    return nb::make_tuple(points.shaped(count, 3), of.shaped(count));
}

}  // namespace

void bind_topology(nb::module_& m) {
    m.def("weld", &rest_of<mr_weld>);
    m.def("clean", &rest_of<mr_clean>);
    m.def("drop_unreferenced", &rest_of<mr_drop_unreferenced>);
    m.def("decimate", &decimate);
    m.def("components", &components);
    m.def("face_normals", &face_normals);
    m.def("vertex_normals", &vertex_normals);
    m.def("spread", &spread);
}

}  // namespace meshreel
