#include "meshreel/fit.h"

#include "check.h"
#include "surfaces.h"

namespace {

constexpr double kLarger = 1.05;

struct Rounds {
    std::vector<double> gates = std::vector<double>(4, 0.3), smoothing = std::vector<double>(4, 0.3);
    std::vector<int32_t> strides{1, 1, 1, 1};

    // Fits a sphere to a larger one; `x` are its vertices afterwards.
    int fit(const Frame& frame, std::vector<double>& x) const {
        const Shape start = sphere(3, 1.0);
        mr_template* fitted = nullptr;
        CHECK(mr_template_create(start.faces.data(), start.face_count(), start.vertices(), &fitted) == MR_OK);
        const mr_target target{
            frame.shape.view(), frame.tree, frame.normals.data(), frame.inside.data(), {nullptr, nullptr, nullptr, 0}};
        const mr_fit_rounds rounds{
            gates.size(), gates.data(), smoothing.data(), strides.data(), 0.3, 0.01, 1e-6, 200, 1};
        x = start.positions;
        const int status = mr_fit(fitted, &target, &rounds, start.positions.data(), start.positions.data(), x.data());
        mr_template_destroy(fitted);
        return status;
    }
};

void check_radius(const std::vector<double>& x, double radius, double off) {
    for (size_t v = 0; v < x.size() / 3; ++v) CHECK(std::fabs(radius_of(&x[3 * v]) - radius) < off);
}

}  // namespace

TEST(a_sphere_reaches_a_larger_one_whether_or_not_early_rounds_leave_points_out) {
    const Frame frame(sphere(4, kLarger));
    std::vector<double> all, some;
    Rounds rounds;
    CHECK(rounds.fit(frame, all) == MR_OK);
    check_radius(all, kLarger, 0.01);
    rounds.strides = {3, 3, 1, 1};
    CHECK(rounds.fit(frame, some) == MR_OK && some != all);
    check_radius(some, kLarger, 0.01);
}

TEST(a_sphere_beyond_the_gate_or_on_an_open_border_pulls_nothing) {
    Frame frame(sphere(4, kLarger));
    std::vector<double> x;
    Rounds rounds;
    rounds.gates.assign(4, 0.02);
    CHECK(rounds.fit(frame, x) == MR_OK);
    check_radius(x, 1.0, 1e-6);
    frame.inside.assign(frame.inside.size(), 0);
    CHECK(Rounds().fit(frame, x) == MR_OK);
    check_radius(x, 1.0, 1e-6);
}

TEST(fits_refuse_gates_strides_and_faces_out_of_range) {
    Frame frame(sphere(2, kLarger));
    std::vector<double> x;
    Rounds rounds;
    rounds.gates[3] = 0.0;
    CHECK(rounds.fit(frame, x) == MR_BAD_INPUT && x == sphere(3, 1.0).positions);
    rounds = {};
    rounds.strides[3] = 0;
    CHECK(rounds.fit(frame, x) == MR_BAD_INPUT);
    frame.shape.faces[0] = -1;
    CHECK(Rounds().fit(frame, x) == MR_BAD_INPUT);
    const int32_t wrong[] = {0, 1, 3};
    mr_template* fitted = nullptr;
    CHECK(mr_template_create(wrong, 1, 3, &fitted) == MR_BAD_INPUT);
}
