#include "meshreel/raster.h"
#include "../src/rigid3.h"
#include "check.h"
#include "surfaces.h"

using namespace meshreel;

namespace {

constexpr mr_crop kPicture{0, 0, 96, 64};

mr_viewer viewer_at(double x, double y, double z, bool parallel = false) {
    mr_viewer viewer{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {-x, -y, -z}, {60, 60}, {48, 32}, parallel};
    if (parallel) viewer.focal[0] = viewer.focal[1] = 16;
    return viewer;
}

struct Drawn {
    Drawn(const Shape& shape, const mr_viewer& viewer, const mr_crop& crop = kPicture)
        : faces(static_cast<size_t>(crop.width * crop.height)), depths(faces.size()) {
        const mr_mesh mesh = shape.view();
        status = mr_draw(&mesh, &viewer, &crop, faces.data(), depths.data());
    }
    size_t covered() const {
        size_t count = 0;
        for (int32_t face : faces) count += face >= 0;
        return count;
    }
    std::vector<int32_t> faces;
    std::vector<double> depths;
    int status;
};

}  // namespace

TEST(pixels_see_the_faces_that_rays_meet) {
    const Frame ball(sphere(4, 1.0));
    const mr_viewer viewer = viewer_at(0.2, -0.1, -3);
    const Drawn drawn(ball.shape, viewer);
    std::vector<double> ways;
    for (int row = 0; row < 64; ++row)
        for (int column = 0; column < 96; ++column)
            for (double number : {(column + 0.5 - 48) / 60, (row + 0.5 - 32) / 60, 1.0}) ways.push_back(number);
    const double eye[3] = {0.2, -0.1, -3};
    const mr_rays rays{eye, ways.data(), 64 * 96, 1};
    std::vector<int32_t> faces(64 * 96);
    std::vector<double> distances(64 * 96), weights;
    CHECK(mr_tree_cast(ball.tree, &rays, faces.data(), distances.data(), nullptr) == MR_OK);
    size_t same = 0;
    for (size_t at = 0; at < faces.size(); ++at) {
        same += faces[at] == drawn.faces[at];
        if (faces[at] >= 0 && drawn.faces[at] >= 0) CHECK(std::fabs(distances[at] - drawn.depths[at]) < 0.02);
        CHECK((drawn.faces[at] < 0) == std::isinf(drawn.depths[at]));
    }
    CHECK(drawn.status == MR_OK && 1000 * same > 990 * faces.size() && drawn.covered() > 500);
    weights.resize(3 * drawn.covered());
    const mr_mesh mesh = ball.shape.view();
    CHECK(mr_draw_weights(&mesh, &viewer, &kPicture, drawn.faces.data(), weights.data()) == MR_OK);
    size_t at = 0;
    for (size_t pixel = 0; pixel < faces.size(); ++pixel) {
        if (drawn.faces[pixel] < 0) continue;
        Vec place{0, 0, 0};
        for (size_t k = 0; k < 3; ++k) {
            const size_t corner = 3 * static_cast<size_t>(drawn.faces[pixel]) + k;
            place =
                place + weights[at++] * load(&ball.shape.positions[3 * static_cast<size_t>(ball.shape.faces[corner])]);
        }
        CHECK(std::fabs(place.z + 3 - drawn.depths[pixel]) < 0.01);
        CHECK(std::fabs(60 * (place.x - 0.2) / (place.z + 3) + 48 - static_cast<double>(pixel % 96) - 0.5) < 0.01);
    }
}

TEST(a_closed_surface_has_no_gap_from_within) {
    const Shape room = sphere(2, 1.0);
    Noise noise(7);
    for (int k = 0; k < 50; ++k) {
        const double x = 0.005 * noise.within(100), y = 0.005 * noise.within(100), z = 0.005 * noise.within(100);
        CHECK(Drawn(room, viewer_at(x, y, z)).covered() == 96 * 64);
    }
}

TEST(faces_are_cut_at_the_plane_of_the_eye_and_far_beside_the_picture) {
    const Shape floor{{-1e7, 1, -1e7, 1e7, 1, -1e7, 0, 1, 3e7}, {0, 1, 2}};
    const Drawn drawn(floor, viewer_at(0, 0, 0));
    for (size_t at = 0; at < drawn.faces.size(); ++at) {
        const double down = (static_cast<double>(at / 96) + 0.5 - 32) / 60;
        CHECK((drawn.faces[at] == 0) == (down > 0));
        if (down > 0) CHECK(std::fabs(drawn.depths[at] * down - 1) < 1e-9);
    }
    CHECK(Drawn(floor, viewer_at(0, 0, 4e7)).covered() == 0);
}

TEST(parallel_rays_begin_behind_everything) {
    const Drawn drawn(sphere(4, 1.0), viewer_at(0, 0, 0.5, true));
    double least = HUGE_VAL;
    for (double depth : drawn.depths) least = std::min(least, depth);
    CHECK(std::fabs(least + 1.5) < 0.01 && std::fabs(static_cast<double>(drawn.covered()) / (256 * 3.1416) - 1) < 0.03);
}

TEST(a_face_seen_edge_on_and_one_without_area_cover_nothing) {
    const Shape flat{{0, 0, 1, 0, 0, 5, 0, 1, 3, 1, 1, 2, 2, 2, 4, 3, 3, 6}, {0, 1, 2, 3, 4, 5, 0, 0, 1}};
    for (bool parallel : {false, true}) CHECK(Drawn(flat, viewer_at(0, 0, 0, parallel)).covered() < 100);
}

TEST(drawing_refuses_faces_out_of_range_and_numbers_that_are_not_finite) {
    Shape shape = tetrahedron();
    mr_viewer viewer = viewer_at(0, 0, -3);
    CHECK(Drawn(shape, viewer).status == MR_OK);
    viewer.center[1] = HUGE_VAL;
    CHECK(Drawn(shape, viewer).status == MR_BAD_INPUT);
    viewer = viewer_at(0, 0, -3);
    viewer.focal[0] = 0;
    CHECK(Drawn(shape, viewer).status == MR_BAD_INPUT);
    viewer = viewer_at(0, 0, -3);
    const mr_mesh mesh = shape.view();
    const mr_crop large{0, 0, 1 << 16, 1};
    CHECK(mr_draw(&mesh, &viewer, &large, nullptr, nullptr) == MR_BAD_INPUT);
    shape.positions[4] = NAN;
    CHECK(Drawn(shape, viewer).status == MR_BAD_INPUT);
    shape = tetrahedron();
    shape.faces[3] = 4;
    CHECK(Drawn(shape, viewer).status == MR_BAD_INPUT);
}
