#include "meshreel/topology.h"

#include <limits>

#include "check.h"
#include "shapes.h"

namespace {

// A mesh, and room for what is left of it.
struct Case {
    std::vector<double> positions;
    std::vector<int32_t> faces;
    std::vector<double> left{};
    std::vector<int32_t> kept{};
    std::vector<int32_t> vertex_origins{}, face_origins{};

    mr_mesh mesh() const { return {positions.data(), positions.size() / 3, faces.data(), faces.size() / 3}; }

    int take(int (*how)(const mr_mesh*, mr_rest*)) {
        left.assign(positions.size(), -1);
        kept.assign(faces.size(), -1);
        vertex_origins.assign(positions.size() / 3, -1);
        face_origins.assign(faces.size() / 3, -1);
        const mr_mesh view = mesh();
        mr_rest rest{left.data(), 0, kept.data(), 0, vertex_origins.data(), face_origins.data()};
        const int status = how(&view, &rest);
        left.resize(3 * rest.vertices);
        kept.resize(3 * rest.face_count);
        vertex_origins.resize(rest.vertices);
        face_origins.resize(rest.face_count);
        return status;
    }
};

using Ints = std::vector<int32_t>;
using Reals = std::vector<double>;

}  // namespace

TEST(welding_merges_equal_positions_in_the_order_of_their_first) {
    Case square{{1, 0, 0, 0, -0.0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0}, {0, 2, 1, 3, 2, 4, 0, 3, 2}};
    CHECK(square.take(mr_weld) == MR_OK);
    CHECK(square.left == Reals({1, 0, 0, 0, -0.0, 0, 0, 1, 0}) && std::signbit(square.left[4]));
    CHECK(square.kept == Ints({0, 2, 1, 0, 2, 1}));
    CHECK(square.vertex_origins == Ints({0, 1, 2}) && square.face_origins == Ints({0, 1}));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    Case none{{nan, 0, 0, nan, 0, 0}, {}};
    CHECK(none.take(mr_weld) == MR_OK && none.left.size() == 6);
}

TEST(blends_weight_corners_and_without_weights_are_their_mean) {
    Case mesh{{3, 0, 0, 0, 3, 0, 0, 0, 6}, {0, 1, 2, 2, 2, 0}};
    const mr_mesh view = mesh.mesh();
    const double weights[] = {1, 0, 0, 0.5, 0, 0.5};
    Reals points(6);
    CHECK(mr_blend(&view, weights, points.data()) == MR_OK && points == Reals({3, 0, 0, 1.5, 0, 3}));
    CHECK(mr_blend(&view, nullptr, points.data()) == MR_OK && points == Reals({1, 1, 2, 1, 0, 4}));
    mesh.faces[4] = 3;
    CHECK(mr_blend(&view, weights, points.data()) == MR_BAD_INPUT);
}

TEST(cleaning_leaves_each_face_with_an_area_once_and_no_loose_vertex) {
    Case mesh{{9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0}, {1, 1, 2, 1, 2, 4, 1, 2, 3, 3, 2, 1, 2, 3, 4}};
    CHECK(mesh.take(mr_clean) == MR_OK);
    CHECK(mesh.kept == Ints({0, 1, 2, 1, 2, 3}) && mesh.left.size() == 12 && mesh.left[0] == 0);
    CHECK(mesh.vertex_origins == Ints({1, 2, 3, 4}) && mesh.face_origins == Ints({2, 4}));
    Case loose{{9, 9, 9, 0, 0, 0, 1, 0, 0, 0, 1, 0}, {1, 1, 2}};
    CHECK(loose.take(mr_drop_unreferenced) == MR_OK && loose.kept == Ints({0, 0, 1}) && loose.left.size() == 6);
    CHECK(loose.vertex_origins == Ints({1, 2}) && loose.face_origins == Ints({0}));
}

TEST(as_many_equal_vertices_and_faces_as_there_are_take_no_square_of_time) {
    const size_t count = 200000;
    Case heap{Reals(3 * count, 0.5), {}};
    for (size_t f = 0; f < count; ++f) heap.faces.insert(heap.faces.end(), {0, 1, 2});
    CHECK(heap.take(mr_weld) == MR_OK && heap.left.size() == 3 && heap.kept.empty());
    heap.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    CHECK(heap.take(mr_clean) == MR_OK && heap.kept == Ints({0, 1, 2}));
}

TEST(components_are_numbered_by_their_first_vertex) {
    const Ints faces{5, 3, 5, 4, 1, 1, 3, 2, 2};
    Ints labels(7);
    CHECK(mr_components(faces.data(), 3, 7, labels.data()) == MR_OK);
    CHECK(labels == Ints({0, 1, 2, 2, 1, 2, 3}));
}

TEST(normals_have_unit_length_or_none) {
    const Case flat{{0, 0, 0, 2, 0, 0, 0, 3, 0, 1, 0, 0}, {0, 1, 2, 0, 3, 1}};
    Reals normals(6), areas(2), own(12);
    const mr_mesh mesh = flat.mesh();
    CHECK(mr_face_normals(&mesh, normals.data(), areas.data()) == MR_OK);
    CHECK(normals == Reals({0, 0, 1, 0, 0, 0}) && areas == Reals({3, 0}));
    CHECK(mr_vertex_normals(&mesh, own.data()) == MR_OK);
    CHECK(own == Reals({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0}));
}

TEST(points_spread_over_a_face_are_the_middles_of_its_equal_parts) {
    const Case pair{{0, 0, 0, 6, 0, 0, 0, 6, 0, 1, 0, 0}, {0, 0, 3, 0, 1, 2}};
    const mr_mesh mesh = pair.mesh();
    Ints parts(2);
    size_t count = 0;
    CHECK(mr_spread_parts(&mesh, 6, 8, parts.data(), &count) == MR_OK);
    CHECK(parts == Ints({1, 2}) && count == 5);
    Reals points(15);
    std::vector<int64_t> faces(5);
    CHECK(mr_spread(&mesh, parts.data(), points.data(), faces.data()) == MR_OK);
    CHECK(faces == std::vector<int64_t>({0, 1, 1, 1, 1}));
    const Reals wanted{1.0 / 3, 0, 0, 1, 1, 0, 1, 4, 0, 4, 1, 0, 2, 2, 0};
    for (size_t k = 0; k < wanted.size(); ++k) CHECK(std::abs(points[k] - wanted[k]) < 1e-12);
    CHECK(mr_spread_parts(&mesh, 1e-9, 8, parts.data(), &count) == MR_OK && parts == Ints({8, 8}));
    for (const double none : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
        CHECK(mr_spread_parts(&mesh, none, 8, parts.data(), &count) == MR_BAD_INPUT);
}

TEST(faces_of_missing_vertices_are_refused) {
    for (const int32_t wrong : {-1, 3, INT32_MAX}) {
        Case bad{{0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, wrong}};
        for (const auto how : {mr_weld, mr_clean, mr_drop_unreferenced}) CHECK(bad.take(how) == MR_BAD_INPUT);
        const mr_mesh mesh = bad.mesh();
        CHECK(mr_components(mesh.faces, 1, 3, nullptr) == MR_BAD_INPUT);
        CHECK(mr_face_normals(&mesh, nullptr, nullptr) == MR_BAD_INPUT);
        CHECK(mr_vertex_normals(&mesh, nullptr) == MR_BAD_INPUT);
        CHECK(mr_spread_parts(&mesh, 1, 8, nullptr, nullptr) == MR_BAD_INPUT);
        CHECK(mr_spread(&mesh, nullptr, nullptr, nullptr) == MR_BAD_INPUT);
    }
    const mr_mesh endless{nullptr, size_t{1} << 31, nullptr, 0};
    CHECK(mr_vertex_normals(&endless, nullptr) == MR_BAD_INPUT);
}
