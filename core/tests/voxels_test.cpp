#include "meshreel/voxels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "check.h"

namespace {

// Eight blocks with the distances from a ball in their middle.
struct Ball {
    std::vector<int32_t> blocks;
    std::vector<float> distances, weights;
    mr_blocks view() { return {blocks.data(), blocks.size() / 3, 0.5, distances.data(), weights.data()}; }
};

Ball ball(float radius) {
    Ball made;
    for (int32_t x = -1; x < 1; ++x)
        for (int32_t y = -1; y < 1; ++y)
            for (int32_t z = -1; z < 1; ++z) {
                made.blocks.insert(made.blocks.end(), {x, y, z});
                for (int32_t k = 0; k < 8; ++k)
                    for (int32_t j = 0; j < 8; ++j)
                        for (int32_t i = 0; i < 8; ++i) {
                            const float p[3] = {float(8 * x + i), float(8 * y + j), float(8 * z + k)};
                            made.distances.push_back(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - radius);
                            made.weights.push_back(1.0f);
                        }
            }
    return made;
}

}  // namespace

TEST(the_zero_level_of_a_ball_is_closed_and_crosses_blocks) {
    Ball made = ball(5.25f);
    const mr_blocks view = made.view();
    mr_zero* zero = nullptr;
    mr_mesh mesh{};
    CHECK(mr_zero_create(&view, 0.5f, &zero, &mesh) == MR_OK);
    CHECK(mesh.vertices > 300 && mesh.face_count == 2 * mesh.vertices - 4);  // Euler
    for (size_t v = 0; v < mesh.vertices; ++v) {
        const double* p = mesh.positions + 3 * v;
        CHECK(std::fabs(std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 0.5 * 5.25) < 0.03);
    }
    mr_zero_destroy(zero);
    CHECK(mr_zero_create(&view, 1.0f, &zero, &mesh) == MR_OK && mesh.face_count == 0);  // no voxel is known
    mr_zero_destroy(zero);
    made.blocks[0] = 5;
    CHECK(mr_zero_create(&view, 0.5f, &zero, &mesh) == MR_BAD_INPUT);
}

TEST(a_picture_moves_the_distances_of_the_voxels_that_it_sees) {
    Ball made = ball(100.0f);
    const mr_blocks view = made.view();
    std::vector<float> depths(16 * 16, 10.0f);
    depths[0] = 0.0f;
    const double projection[12] = {8, 0, 8, 80, 0, 8, 8, 80, 0, 0, 1, 10}, eye[3] = {0, 0, -10};
    const double ways[9] = {0.125, 0, -1, 0, 0.125, -1, 0, 0, 1};
    const mr_depth picture{depths.data(), 16, 16, projection, ways, eye};
    CHECK(mr_integrate(&picture, 1.5, &view) == MR_OK);
    for (size_t n = 0; n < view.count; ++n)
        for (size_t k = 0; k < 8; ++k) {  // the column of voxels at x = 8 block, y = 8 block
            const size_t at = 512 * n + 64 * k;
            const double z = 0.5 * (8 * made.blocks[3 * n + 2] + static_cast<int32_t>(k));
            const bool seen = z <= 1.5;
            CHECK(made.weights[at] == (seen ? 2.0f : 1.0f));
            if (seen) CHECK(made.distances[at] < -35.0f);
        }
    mr_touched* touched = nullptr;
    const int32_t* blocks = nullptr;
    size_t count = 0;
    CHECK(mr_touched_create(&picture, 0.5, 1.5, &touched, &blocks, &count) == MR_OK && count > 20);
    bool found = false;
    for (size_t n = 0; n < count; ++n) {
        CHECK(blocks[3 * n + 2] == 0 || blocks[3 * n + 2] == -1);
        found |= blocks[3 * n] == 0 && blocks[3 * n + 1] == 0 && blocks[3 * n + 2] == 0;
    }
    CHECK(found);
    mr_touched_destroy(touched);
    CHECK(mr_touched_create(&picture, 0.0, 1.5, &touched, &blocks, &count) == MR_BAD_INPUT);
}

TEST(points_of_a_plane_give_its_distances_up_to_its_border) {
    Ball made = ball(0.0f);
    std::fill(made.weights.begin(), made.weights.end(), 0.0f);
    const mr_blocks view = made.view();
    std::vector<double> positions, normals;
    for (int x = -6; x <= 6; ++x)
        for (int y = -6; y <= 6; ++y) {
            positions.insert(positions.end(), {0.25 * x, 0.25 * y, 0.1});
            normals.insert(normals.end(), {0, 0, 1});
        }
    const mr_oriented points{positions.data(), normals.data(), positions.size() / 3};
    CHECK(mr_point_distances(&points, 1.0, 0.3, &view) == MR_OK);
    size_t known = 0;
    for (size_t n = 0; n < view.count; ++n)
        for (size_t v = 0; v < 512; ++v) {
            const double x = 0.5 * (8 * made.blocks[3 * n] + static_cast<int32_t>(v % 8));
            const double y = 0.5 * (8 * made.blocks[3 * n + 1] + static_cast<int32_t>(v / 8 % 8));
            const double z = 0.5 * (8 * made.blocks[3 * n + 2] + static_cast<int32_t>(v / 64));
            const bool near = std::fabs(z - 0.1) < 1.0, inside = std::fabs(x) <= 1.0 && std::fabs(y) <= 1.0;
            if (made.weights[512 * n + v] > 0) {
                CHECK(near && std::fabs(made.distances[512 * n + v] - (z - 0.1)) < 1e-6);
                CHECK(std::fabs(x) < 2.0 && std::fabs(y) < 2.0);
                ++known;
            } else {
                CHECK(!(near && inside));
            }
        }
    CHECK(known >= 4 * 25);
    CHECK(mr_point_distances(&points, 0.0, 0.3, &view) == MR_BAD_INPUT);
    CHECK(mr_point_distances(&points, 4.5, 0.3, &view) == MR_BAD_INPUT);  // farther than a block is wide
    positions[0] = std::nan("");
    CHECK(mr_point_distances(&points, 1.0, 0.3, &view) == MR_BAD_INPUT);
}
