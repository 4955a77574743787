#include <nanobind/stl/optional.h>

#include <optional>

#include "arrays.h"
#include "meshreel/decimate.h"
#include "meshreel/topology.h"

namespace meshreel {
namespace {

// Remainder of a mesh.
struct Rest {
    const mr_mesh mesh;
    Buffer<double> positions;
    Buffer<int32_t> faces;
    mr_rest rest;

    explicit Rest(const mr_mesh& of)
        : mesh(of),
          positions(3 * of.vertices),
          faces(3 * of.face_count),
          rest{positions.data(), of.vertices, faces.data(), of.face_count, nullptr, nullptr} {}
    Out<double, 2> left() {
        if (rest.vertices < mesh.vertices) positions = Buffer<double>(positions.data(), 3 * rest.vertices);
        return positions.shaped(rest.vertices, 3);
    }
    Out<int32_t, 2> kept() {
        if (rest.face_count < mesh.face_count) faces = Buffer<int32_t>(faces.data(), 3 * rest.face_count);
        return faces.shaped(rest.face_count, 3);
    }
};

template <int (*take)(const mr_mesh*, mr_rest*)>
nb::tuple rest_of(In<double, 2> positions, In<int32_t, 2> faces) {
    Rest left(mesh_of(positions, faces));
    Buffer<int32_t> vertex_origins(left.mesh.vertices), face_origins(left.mesh.face_count);
    left.rest.vertex_origins = vertex_origins.data(), left.rest.face_origins = face_origins.data();
    check(take(&left.mesh, &left.rest));
    const size_t vertices = left.rest.vertices, faces_left = left.rest.face_count;
    return nb::make_tuple(left.left(), left.kept(), vertex_origins.shaped(vertices), face_origins.shaped(faces_left));
}

nb::tuple decimate(In<double, 2> positions, In<int32_t, 2> faces, size_t wanted, double border) {
    Rest left(mesh_of(positions, faces));
    check(without_gil([&] { return mr_decimate(&left.mesh, wanted, border, &left.rest); }));
    return nb::make_tuple(left.left(), left.kept());
}

Out<int32_t, 1> components(In<int32_t, 2> faces, size_t vertices) {
    expect(faces.shape(1) == 3);
    Buffer<int32_t> labels(vertices);
    check(without_gil([&] { return mr_components(faces.data(), faces.shape(0), vertices, labels.data()); }));
    return labels.shaped(vertices);
}

nb::tuple face_normals(In<double, 2> positions, In<int32_t, 2> faces) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<double> normals(3 * mesh.face_count), areas(mesh.face_count);
    check(without_gil([&] { return mr_face_normals(&mesh, normals.data(), areas.data()); }));
    return nb::make_tuple(normals.shaped(mesh.face_count, 3), areas.shaped(mesh.face_count));
}

Out<double, 2> vertex_normals(In<double, 2> positions, In<int32_t, 2> faces) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<double> normals(3 * mesh.vertices);
    check(without_gil([&] { return mr_vertex_normals(&mesh, normals.data()); }));
    return normals.shaped(mesh.vertices, 3);
}

Out<double, 2> blend(In<double, 2> values, In<int32_t, 2> corners, std::optional<In<double, 2>> weights) {
    const mr_mesh mesh = mesh_of(values, corners);
    if (weights) expect(weights->shape(0) == mesh.face_count && weights->shape(1) == 3);
    Buffer<double> points(3 * mesh.face_count);
    const double* shares = weights ? weights->data() : nullptr;
    check(without_gil([&] { return mr_blend(&mesh, shares, points.data()); }));
    return points.shaped(mesh.face_count, 3);
}

nb::tuple spread(In<double, 2> positions, In<int32_t, 2> faces, double spacing, int32_t most) {
    const mr_mesh mesh = mesh_of(positions, faces);
    Buffer<int32_t> parts(mesh.face_count);
    size_t count = 0;
    check(without_gil([&] { return mr_spread_parts(&mesh, spacing, most, parts.data(), &count); }));
    Buffer<double> points(3 * count);
    Buffer<int64_t> of(count);
    check(without_gil([&] { return mr_spread(&mesh, parts.data(), points.data(), of.data()); }));
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
    m.def("blend", &blend, nb::arg("values"), nb::arg("corners"), nb::arg("weights").none());
    m.def("vertex_normals", &vertex_normals);
    m.def("spread", &spread);
}

}  // namespace meshreel
