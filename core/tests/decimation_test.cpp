#include "meshreel/decimate.h"

#include "check.h"
#include "shapes.h"

namespace {

Shape decimated(const Shape& shape, size_t faces, double border) {
    Shape left{std::vector<double>(shape.positions.size()), std::vector<int32_t>(shape.faces.size())};
    const mr_mesh mesh = shape.view();
    mr_rest rest{left.positions.data(), 0, left.faces.data(), 0, nullptr, nullptr};
    CHECK(mr_decimate(&mesh, faces, border, &rest) == MR_OK);
    left.positions.resize(3 * rest.vertices);
    left.faces.resize(3 * rest.face_count);
    return left;
}

double area(const Shape& shape) {  // of a sheet in the plane z = 0, whose faces face upwards
    double sum = 0;
    for (size_t f = 0; f < shape.face_count(); ++f) {
        const double *a = &shape.positions[3 * shape.faces[3 * f]], *b = &shape.positions[3 * shape.faces[3 * f + 1]],
                     *c = &shape.positions[3 * shape.faces[3 * f + 2]];
        const double twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        CHECK(twice > 0);
        sum += twice / 2;
    }
    return sum;
}

}  // namespace

TEST(a_flat_sheet_keeps_its_area_and_its_plane) {
    const Shape left = decimated(sheet(12), 8, 10);
    CHECK(left.face_count() <= 8 && std::abs(area(left) - 121) < 1e-9);
    for (size_t v = 0; v < left.vertices(); ++v) CHECK(std::abs(left.positions[3 * v + 2]) < 1e-12);
}

TEST(without_weight_borders_recede) { CHECK(area(decimated(sheet(12), 8, 0)) < 120); }

TEST(a_mesh_that_has_few_enough_faces_stays_as_it_is) {
    const Shape solid = tetrahedron(), left = decimated(solid, 4, 10);
    CHECK(left.positions == solid.positions && left.faces == solid.faces);
}

TEST(a_bent_sheet_stays_near_its_surface_and_turns_no_face_over) {
    const Shape left = decimated(sheet(20, 0.02), 60, 10);
    CHECK(left.face_count() <= 60 && left.face_count() > 40);
    area(left);  // no face is turned over as seen from above
    for (size_t v = 0; v < left.vertices(); ++v) {
        const double* p = &left.positions[3 * v];
        CHECK(std::abs(p[2] - 0.02 * p[0] * p[1]) < 0.05);
    }
}

TEST(faces_in_any_state_are_decimated) {
    const Shape heap{{0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5}, {0, 1, 2, 0, 1, 2, 2, 1, 0, 0, 0, 1, 3, 3, 3}};
    for (size_t faces = 0; faces < 6; ++faces) CHECK(decimated(heap, faces, 10).face_count() <= 5);
    CHECK(decimated({}, 4, 10).faces.empty());
}

TEST(faces_of_missing_vertices_are_not_decimated) {
    const std::vector<double> positions(9);
    for (const int32_t wrong : {-1, 3}) {
        const int32_t faces[] = {0, 1, wrong};
        const mr_mesh mesh{positions.data(), 3, faces, 1};
        CHECK(mr_decimate(&mesh, 0, 10, nullptr) == MR_BAD_INPUT);
    }
}
