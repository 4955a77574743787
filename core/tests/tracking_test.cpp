#include "meshreel/tracking.h"

#include "check.h"
#include "shapes.h"

namespace {

std::vector<double> cube(int side) {
    std::vector<double> points;
    for (int k = 0; k < side * side * side; ++k)
        for (int axis : {k % side, k / side % side, k / side / side}) points.push_back(double(axis) / side);
    return points;
}

}  // namespace

TEST(centers_spread_evenly_and_own_what_is_nearest) {
    const std::vector<double> samples = cube(8);
    std::vector<double> centers{0, 0, 0, 0.01, 0, 0};
    std::vector<int32_t> owners(512);
    const mr_relaxation problem{samples.data(), 512, nullptr, 2, {nullptr, nullptr, nullptr}, 1.0, 0.0, 1e-6, 200};
    mr_relaxed result{centers.data(), nullptr, owners.data(), 0, 0};
    CHECK(mr_relax_centers(&problem, &result) == MR_OK && result.rounds > 1);
    for (size_t s = 0; s < 512; ++s) {
        double squares[2] = {0, 0};
        for (size_t c = 0; c < 2; ++c)
            for (size_t k = 0; k < 3; ++k) squares[c] += std::pow(centers[3 * c + k] - samples[3 * s + k], 2);
        CHECK(squares[static_cast<size_t>(owners[s])] <= squares[static_cast<size_t>(1 - owners[s])]);
    }
    mr_relaxed nothing{nullptr, nullptr, nullptr, 0, 0};
    CHECK(mr_relax_centers(&problem, &nothing) == MR_BAD_INPUT && mr_relax_centers(nullptr, &result) == MR_BAD_INPUT);
}

TEST(equal_motions_differ_by_nothing_and_a_shift_by_its_square) {
    const int32_t offsets[] = {0, 1, 2}, indices[] = {1, 0}, wrong[] = {2, 0};
    const double ones[] = {1, 1}, rotations[18] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double means[6] = {1, 2, 3, 4, 5, 6},
                 covariances[18] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    double shifts[6] = {0, 0, 0, 0, 0, 0}, out[2];
    const mr_neighbours neighbours{offsets, indices, ones}, bad{offsets, wrong, ones};
    CHECK(mr_motion_differences(2, &neighbours, rotations, shifts, means, covariances, out) == MR_OK && out[0] == 0);
    shifts[1] = 3;
    CHECK(mr_motion_differences(2, &neighbours, rotations, shifts, means, covariances, out) == MR_OK);
    CHECK(out[0] == 9 && out[1] == 9);
    CHECK(mr_motion_differences(2, &bad, rotations, shifts, means, covariances, out) == MR_BAD_INPUT);
    CHECK(mr_motion_differences(0, &neighbours, rotations, shifts, means, covariances, out) == MR_BAD_INPUT);
}
