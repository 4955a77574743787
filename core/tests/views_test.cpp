#include "meshreel/views.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "check.h"

namespace {

constexpr int32_t kWide = 64, kHigh = 48;

// A camera at the origin that looks along z at a plane two units away, with a picture as red as a column is to the
// right.
struct Scene {
    std::vector<float> depth = std::vector<float>(kWide * kHigh, 2.0f);
    std::vector<uint8_t> from_step = std::vector<uint8_t>(kWide * kHigh, 255), pixels;
    mr_view view{};
    Scene() {
        for (int32_t row = 0; row < kHigh; ++row)
            for (int32_t column = 0; column < kWide; ++column)
                for (int value : {2 * column, 40, 7}) pixels.push_back(static_cast<uint8_t>(value));
        view.viewer = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}, {50, 50}, {32, 24}, 0};
        view.width = view.columns = view.picture_columns = kWide;
        view.height = view.rows = view.picture_rows = kHigh;
        view.shrink = 1, view.margin = 0.01, view.share = 0.01, view.least = 0.01;
        view.depth = depth.data(), view.from_step = from_step.data(), view.pixels = pixels.data();
        for (double& gain : view.gains) gain = 1;
    }
    // The weight of a place that faces the camera, and its colour in `sums`.
    double seen(double x, double y, double z, double facing = -1) {
        const double point[3] = {x, y, z}, normal[3] = {0, 0, facing};
        double weight = 0;
        std::fill(sums, sums + 3, 0.0);
        CHECK(mr_add_view(&view, point, normal, 1, sums, &weight) == MR_OK);
        return weight;
    }
    double sums[3];
};

}  // namespace

TEST(a_place_has_the_blended_color_of_its_pixels_times_its_weight) {
    Scene scene;
    const double weight = scene.seen(0.1, 0.2, 2);  // at 34.5, 29 of the picture
    const double cosine = 2 / std::sqrt(0.01 + 0.04 + 4);
    CHECK(std::fabs(weight - cosine * cosine * cosine) < 1e-12);
    CHECK(std::fabs(scene.sums[0] / weight - 68) < 1e-9 && std::fabs(scene.sums[1] / weight - 40) < 1e-9);
    scene.view.gains[1] = 2;
    CHECK(scene.seen(0.1, 0.2, 2) == weight && std::fabs(scene.sums[1] / weight - 20) < 1e-9);
}

TEST(places_that_the_camera_did_not_see_have_no_weight) {
    Scene scene;
    CHECK(scene.seen(0, 0, 2.019) > 0 && scene.seen(0, 0, 2.05) == 0);  // behind the surface
    CHECK(scene.seen(0, 0, 1.95) == 0 && scene.seen(0, 0, 2, 1) == 0);  // before it, and turned away
    CHECK(scene.seen(2, 0, 2) == 0 && scene.seen(0, 0, -2) == 0);       // beside the picture, behind the eye
    CHECK(scene.seen(std::numeric_limits<double>::quiet_NaN(), 0, 2) == 0);
    std::fill(scene.depth.begin(), scene.depth.end(), std::numeric_limits<float>::infinity());
    CHECK(scene.seen(0, 0, 2) == 0);
}

TEST(places_near_a_step_count_less_and_at_one_keep_a_share_that_is_asked_for) {
    Scene scene;
    std::fill(scene.from_step.begin(), scene.from_step.end(), 51);
    CHECK(std::fabs(scene.seen(0, 0, 2) - 0.2) < 1e-12);
    std::fill(scene.from_step.begin(), scene.from_step.end(), 0);
    CHECK(scene.seen(0, 0, 2) == 0);
    scene.view.at_step = 0.1;
    CHECK(std::fabs(scene.seen(0, 0, 2) - 0.1) < 1e-12);
}

TEST(a_lens_that_bends_moves_the_color_and_not_the_depth) {
    Scene scene;
    scene.view.bend[0] = 0.5, scene.view.bends = 1;
    const double weight = scene.seen(0.4, 0, 2);  // at 0.2 of the plane at depth 1, bent to 0.204
    CHECK(std::fabs(scene.sums[0] / weight - 2 * (32 + 50 * 0.204 - 0.5)) < 1e-9);
}

TEST(depths_and_steps_are_those_of_the_pixel_that_sees_a_place) {
    Scene scene;
    scene.view.shrink = 2, scene.view.columns = kWide / 2, scene.view.rows = kHigh / 2;
    for (int32_t row = 0; row < scene.view.rows; ++row)
        for (int32_t column = 0; column < scene.view.columns; ++column)  // the plane z = 2 + x / 2
            scene.depth[static_cast<size_t>(row * scene.view.columns + column)] =
                static_cast<float>(2 / (1 - 0.5 * (2 * column + 1 - 32) / 50));
    CHECK(scene.seen(0.8, 0.3, 2.4) > 0 && scene.seen(-0.8, 0.3, 1.6) > 0);
    CHECK(scene.seen(-0.8, 0.3, 2.4) == 0 && scene.seen(0.3, 0.8, 2.4) == 0);
    const double weight = scene.seen(0.8, 0.3, 2.4), red = scene.sums[0] / weight;
    CHECK(std::fabs(red - 2 * (32 + 50 * 0.8 / 2.4 - 0.5)) < 1e-9);
    scene.from_step[static_cast<size_t>(15 * scene.view.columns + 24)] = 51;  // of the pixel at 48.67, 30.25
    CHECK(std::fabs(scene.seen(0.8, 0.3, 2.4) - 0.2 * weight) < 1e-12);
    CHECK(std::fabs(scene.seen(0.9, 0.3, 2.45) - 0.2 * weight) > 0.1);  // the pixel beside it
}

TEST(without_pixels_weights_alone_are_found) {
    Scene scene;
    scene.view.pixels = nullptr;
    CHECK(scene.seen(0.9, 0.5, 2) > 0 && scene.sums[0] == 0);
}

TEST(a_view_without_depths_is_refused) {
    Scene scene;
    scene.view.rows = 0;
    const double place[3] = {0, 0, 2};
    CHECK(mr_add_view(&scene.view, place, place, 1, nullptr, nullptr) == MR_BAD_INPUT);
}
