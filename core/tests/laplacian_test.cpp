#include "meshreel/laplacian.h"

#include <algorithm>

#include "check.h"
#include "shapes.h"

namespace {

struct System {
    System(const Shape& shape, const std::vector<int32_t>& anchors, double weight = 1.0) {
        const mr_mesh mesh = shape.view();
        status = mr_laplacian_create(&mesh, anchors.data(), static_cast<int64_t>(anchors.size()), weight, &made);
    }
    System(const System&) = delete;
    ~System() { mr_laplacian_destroy(made); }
    mr_laplacian* made = nullptr;
    int status;
};

std::vector<int32_t> first(int32_t count) {
    std::vector<int32_t> anchors(static_cast<size_t>(count));
    for (int32_t k = 0; k < count; ++k) anchors[static_cast<size_t>(k)] = k;
    return anchors;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (size_t k = 0; k < a.size(); ++k) most = std::max(most, std::fabs(a[k] - b[k]));
    return most;
}

}  // namespace

TEST(weights_of_a_row_sum_to_one_and_are_those_of_edges) {
    const System system(sheet(5, 0.1), {0});
    const int64_t count = mr_laplacian_weights(system.made, nullptr, nullptr, nullptr);
    CHECK(count == 2 * (2 * 4 * 5 + 16));  // each edge both ways
    std::vector<int32_t> rows(static_cast<size_t>(count)), columns(rows);
    std::vector<double> weights(rows.size()), sums(25);
    mr_laplacian_weights(system.made, rows.data(), columns.data(), weights.data());
    for (size_t k = 0; k < rows.size(); ++k) {
        CHECK(weights[k] > 0 && rows[k] != columns[k]);
        sums[static_cast<size_t>(rows[k])] += weights[k];
    }
    for (double sum : sums) CHECK(std::fabs(sum - 1) < 1e-14);
}

TEST(the_inverse_undoes_the_forward_product_for_few_and_many_anchors) {
    const Shape shape = sheet(8, 0.1);
    for (int32_t anchors : {1, 3, 40}) {
        const System system(shape, first(anchors), 2.0);
        Noise noise(1);
        std::vector<double> weights(2 * 64), found(weights.size()), deltas(2 * (64 + static_cast<size_t>(anchors)));
        for (double& weight : weights) weight = noise.within(1000) / 1000.0;
        CHECK(mr_laplacian_forward(system.made, weights.data(), 2, deltas.data()) == MR_OK);
        CHECK(mr_laplacian_inverse(system.made, deltas.data(), 2, found.data()) == MR_OK);
        CHECK(distance(found, weights) < 1e-9);
        std::vector<double> at_once(found.size());
        const mr_mesh mesh = shape.view();
        CHECK(mr_laplacian_solve(&mesh, first(anchors).data(), anchors, 2.0, deltas.data(), 2, at_once.data()) ==
              MR_OK);
        CHECK(at_once == found);
    }
}

TEST(quantised_deltas_decode_near_the_weights) {
    const System system(sheet(8, 0.1), {0, 63}, 8.0);
    std::vector<double> weights(64), deltas(66), found(64);
    for (size_t v = 0; v < 64; ++v) weights[v] = std::sin(0.3 * double(v % 8)) + 0.1 * double(v / 8);
    mr_laplacian_forward(system.made, weights.data(), 1, deltas.data());
    std::vector<int32_t> numbers(66);
    const double step = 0.01, price = 0.0;
    CHECK(mr_laplacian_quantize(system.made, deltas.data(), 1, &step, &price, numbers.data()) == MR_OK);
    for (size_t k = 0; k < 66; ++k) deltas[k] = step * numbers[k];
    CHECK(mr_laplacian_inverse(system.made, deltas.data(), 1, found.data()) == MR_OK);
    CHECK(distance(found, weights) < 5 * step);
}

TEST(a_part_without_an_anchor_has_no_solution_and_a_lone_vertex_needs_none) {
    Shape shape = sheet(4);
    const size_t shift = shape.vertices();
    const Shape other = tetrahedron();
    shape.positions.insert(shape.positions.end(), other.positions.begin(), other.positions.end());
    for (int32_t corner : other.faces) shape.faces.push_back(corner + static_cast<int32_t>(shift));
    shape.positions.insert(shape.positions.end(), {9, 9, 9});
    std::vector<double> deltas(23, 1.0), weights(21);
    const mr_mesh mesh = shape.view();
    const std::vector<int32_t> one{0}, both{0, 17};
    CHECK(mr_laplacian_solve(&mesh, one.data(), 1, 1.0, deltas.data(), 1, weights.data()) == MR_SINGULAR);
    CHECK(mr_laplacian_solve(&mesh, both.data(), 2, 1.0, deltas.data(), 1, weights.data()) == MR_OK);
    CHECK(weights[20] == 1.0);
}

TEST(hostile_systems_are_refused) {
    CHECK(System(tetrahedron(), {2, 1}).status == MR_BAD_INPUT);
    CHECK(System(tetrahedron(), {1, 1}).status == MR_BAD_INPUT);
    for (int32_t anchor : {-1, 4}) CHECK(System(tetrahedron(), {anchor}).status == MR_BAD_INPUT);
    Shape faces = tetrahedron(), places = faces, collapsed = faces;
    faces.faces[0] = 4, places.positions[0] = NAN;
    CHECK(System(faces, {0}).status == MR_BAD_INPUT && System(places, {0}).status == MR_BAD_INPUT);
    collapsed.faces = {0, 0, 1, 1, 2, 1}, collapsed.positions.assign(12, 0.0);  // no face ties these vertices
    const System system(collapsed, {0});
    CHECK(system.status == MR_OK && mr_laplacian_weights(system.made, nullptr, nullptr, nullptr) == 0);
}

TEST(a_field_is_its_mean_and_weighted_vectors) {
    const double weights[] = {2, 0, -1, 4}, vectors[] = {1, 0, 0, 0, 1, 8}, mean[] = {0.5, 0, 1};
    double field[6];
    mr_klt_inverse(weights, 2, 2, vectors, mean, 3, field);
    const double wanted[] = {2.5, 0, 1, -0.5, 4, 33};
    CHECK(std::equal(field, field + 6, wanted));
}

TEST(anchors_are_far_apart_and_in_each_part) {
    const Shape shape = sheet(6);
    std::vector<int32_t> anchors(36);
    const auto found = [&](const std::vector<int32_t>& faces, int64_t vertices, int64_t count) {
        return mr_farthest_anchors(faces.data(), static_cast<int64_t>(faces.size() / 3), vertices, count,
                                   anchors.data());
    };
    CHECK(found(shape.faces, 36, 2) == 2 && anchors[0] == 0 && anchors[1] == 35);
    CHECK(found(shape.faces, 36, 99) == 36);
    CHECK(found({0, 1, 2, 3, 4, 5}, 7, 0) == 2 && anchors[0] == 0 && anchors[1] == 3);
    CHECK(found({}, 4, 3) == 0);
    CHECK(found({0, 1, 4}, 4, 1) < 0 && found({0, -1, 2}, 4, 1) < 0 && found({}, -1, 1) < 0 && found({}, 4, -1) < 0);
}
