#include "meshreel/tree.h"

#include <algorithm>
#include <limits>

#include "../src/rigid3.h"
#include "check.h"
#include "shapes.h"

using namespace meshreel;

namespace {

constexpr double kEnough = 1e-5;  // single precision chooses the face, of triangles of a size of 1

// Random triangles, of which every seventh is a line, every eleventh a point, and the last half repeats the first.
Shape triangles(uint32_t seed, size_t count) {
    Noise noise(seed);
    Shape shape;
    for (size_t k = 0; k < 9 * count; ++k) shape.positions.push_back(0.001 * noise.within(1000));
    for (int32_t f = 0; f < static_cast<int32_t>(count); ++f) {
        const int32_t second = f % 11 == 0 ? 3 * f : 3 * f + 1, third = f % 11 == 0 || f % 7 == 0 ? second : 3 * f + 2;
        shape.faces.insert(shape.faces.end(), {3 * f, second, third});
    }
    const std::vector<int32_t> once = shape.faces;
    shape.faces.insert(shape.faces.end(), once.begin(), once.end());
    return shape;
}

double to_segment(Vec p, Vec a, Vec b) {
    const double size = dot(b - a, b - a), t = size > 0 ? std::clamp(dot(p - a, b - a) / size, 0.0, 1.0) : 0.0;
    const Vec gap = p - a - t * (b - a);
    return std::sqrt(dot(gap, gap));
}

double to_triangle(Vec p, Vec a, Vec b, Vec c) {
    const Vec n = cross(b - a, c - a);
    const double edges = std::min({to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a)});
    const bool over = dot(cross(b - a, p - a), n) >= 0 && dot(cross(c - b, p - b), n) >= 0 &&
                      dot(cross(a - c, p - c), n) >= 0 && dot(n, n) > 0;
    return over ? std::fabs(dot(p - a, n)) / std::sqrt(dot(n, n)) : edges;
}

// Checks the tree's answers against all faces; returns them.
std::vector<int32_t> checked(const mr_tree* tree, const Shape& shape, std::vector<int32_t> guesses) {
    Noise noise(7);
    const size_t count = guesses.size();
    std::vector<double> queries, weights(3 * count);
    for (size_t k = 0; k < 3 * count; ++k) queries.push_back(0.0015 * noise.within(1000));
    std::vector<int32_t> found = guesses;
    CHECK(mr_tree_closest(tree, queries.data(), count, HUGE_VAL, nullptr, found.data(), weights.data()) == MR_OK);
    const auto corner = [&](size_t f, size_t k) {
        return load(&shape.positions[3 * static_cast<size_t>(shape.faces[3 * f + k])]);
    };
    for (size_t q = 0; q < count; ++q) {
        const Vec query = load(&queries[3 * q]);
        double least = HUGE_VAL;
        for (size_t f = 0; f < shape.face_count(); ++f)
            least = std::min(least, to_triangle(query, corner(f, 0), corner(f, 1), corner(f, 2)));
        Vec gap = query;
        for (size_t k = 0; k < 3; ++k) {
            CHECK(weights[3 * q + k] >= 0);
            gap = gap - weights[3 * q + k] * corner(static_cast<size_t>(found[q]), k);
        }
        CHECK(std::fabs(weights[3 * q] + weights[3 * q + 1] + weights[3 * q + 2] - 1) < 1e-12);
        CHECK(std::fabs(std::sqrt(dot(gap, gap)) - least) < kEnough);
        CHECK(static_cast<size_t>(found[q]) < shape.face_count() / 2);  // of equal faces the first
        int32_t face = guesses[q];                                      // just out of reach
        double unused[3];
        CHECK(mr_tree_closest(tree, &queries[3 * q], 1, least - kEnough, nullptr, &face, unused) == MR_OK &&
              face == -1);
    }
    return found;
}

}  // namespace

TEST(closest_points_are_those_of_all_faces_whatever_the_guess_and_after_moves) {
    Shape shape = triangles(1, 200);
    const mr_mesh mesh = shape.view();
    mr_tree* tree = nullptr;
    CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
    Noise noise(3);
    std::vector<int32_t> guesses(100);
    for (int32_t& guess : guesses) guess = static_cast<int32_t>(noise.next() % shape.face_count());
    CHECK(checked(tree, shape, guesses) == checked(tree, shape, std::vector<int32_t>(100, -1)));
    shape.positions = triangles(2, 200).positions;
    CHECK(mr_tree_move(tree, shape.positions.data()) == MR_OK);
    CHECK(checked(tree, shape, guesses) == checked(tree, shape, std::vector<int32_t>(100, -1)));
    mr_tree_destroy(tree);
}

TEST(queries_that_are_not_finite_reach_no_empty_box) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    for (size_t count = 1; count < 12; ++count) {
        const Shape shape = triangles(5, count);
        const mr_mesh mesh = shape.view();
        mr_tree* tree = nullptr;
        CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
        for (double x : {nan, inf, -inf, 1e300, -1e300})
            for (double reach : {inf, 1.0}) {
                const double query[] = {x, x, x};
                int32_t face = -1;
                double weights[3];
                CHECK(mr_tree_closest(tree, query, 1, reach, nullptr, &face, weights) == MR_OK);
                CHECK(face >= -1 && face < static_cast<int32_t>(shape.face_count()));
            }
        mr_tree_destroy(tree);
    }
}

TEST(vertices_that_are_not_finite_build_a_tree_that_answers_with_a_face) {
    for (double x : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e39}) {
        Shape shape = triangles(6, 200);
        shape.positions[100] = x;
        const mr_mesh mesh = shape.view();
        mr_tree* tree = nullptr;
        CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
        std::vector<uint8_t> gone(shape.face_count(), 1);
        gone[7] = 0;
        for (int moves = 0; moves < 2; ++moves) {
            const double query[] = {0.1, 0.2, 0.3}, far[] = {1e25, 0.0, 0.0},
                         inf = std::numeric_limits<double>::infinity();
            for (const double* asked : {query, far}) {
                int32_t face = -1;
                double weights[3];
                CHECK(mr_tree_closest(tree, asked, 1, inf, gone.data(), &face, weights) == MR_OK && face == 7);
            }
            CHECK(mr_tree_move(tree, shape.positions.data()) == MR_OK);
        }
        mr_tree_destroy(tree);
    }
}

TEST(the_closest_point_of_a_face_that_is_a_line_but_for_rounding_is_beside_the_query) {
    Shape shape;  // from the decimation of a room: the corner line of two walls
    shape.positions = {
        2.22044605e-16, -1.11022302e-16, 2.34, -2.66453526e-14, -6.28386232e-14, 0.06, 1.11022302e-16, 0.0, 2.40};
    shape.faces = {0, 1, 2};
    const mr_mesh mesh = shape.view();
    mr_tree* tree = nullptr;
    CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
    for (int k = 1; k < 40; ++k) {
        const double query[3] = {0.0, 0.0, 0.06 * k};
        int32_t face = -1;
        double w[3];
        CHECK(mr_tree_closest(tree, query, 1, HUGE_VAL, nullptr, &face, w) == MR_OK && face == 0);
        CHECK(std::fabs(2.34 * w[0] + 0.06 * w[1] + 2.40 * w[2] - query[2]) < 1e-9);
    }
    mr_tree_destroy(tree);
}

TEST(faces_that_are_gone_answer_no_query) {
    const Shape shape = triangles(1, 200);
    const mr_mesh mesh = shape.view();
    mr_tree* tree = nullptr;
    CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
    Noise noise(9);
    std::vector<double> queries, weights(3 * 300);
    for (int k = 0; k < 3 * 300; ++k) queries.push_back(0.0015 * noise.within(1000));
    std::vector<int32_t> faces(300, -1);
    CHECK(mr_tree_closest(tree, queries.data(), 300, HUGE_VAL, nullptr, faces.data(), weights.data()) == MR_OK);
    std::vector<uint8_t> gone(shape.face_count(), 0);
    for (int32_t face : faces) gone[static_cast<size_t>(face)] = 1;
    std::vector<int32_t> others = faces;  // guesses that are gone, too
    CHECK(mr_tree_closest(tree, queries.data(), 300, HUGE_VAL, gone.data(), others.data(), weights.data()) == MR_OK);
    for (int32_t face : others) CHECK(face >= 0 && gone[static_cast<size_t>(face)] == 0);
    mr_tree_destroy(tree);
}

TEST(rays_meet_the_nearest_of_all_faces) {
    const Shape shape = triangles(1, 200);
    const mr_mesh mesh = shape.view();
    mr_tree* tree = nullptr;
    CHECK(mr_tree_create(&mesh, &tree) == MR_OK);
    Noise noise(4);
    std::vector<double> origins, ways;
    for (int k = 0; k < 3 * 500; ++k) {
        origins.push_back(0.002 * noise.within(1000));
        ways.push_back(0.001 * noise.within(1000) - origins.back());
    }
    std::vector<int32_t> faces(500);
    std::vector<double> distances(500), weights(1500);
    const mr_rays rays{origins.data(), ways.data(), 500, 0};
    CHECK(mr_tree_cast(tree, &rays, faces.data(), distances.data(), weights.data()) == MR_OK);
    size_t met = 0;
    for (size_t r = 0; r < 500; ++r) {
        const Vec from = load(&origins[3 * r]), way = load(&ways[3 * r]);
        double least = HUGE_VAL;
        for (size_t f = 0; f < shape.face_count(); ++f) {
            Vec p[3];
            for (size_t k = 0; k < 3; ++k)
                p[k] = load(&shape.positions[3 * static_cast<size_t>(shape.faces[3 * f + k])]) - from;
            const double a = dot(cross(p[1], p[2]), way), b = dot(cross(p[2], p[0]), way),
                         c = dot(cross(p[0], p[1]), way), t = dot(p[0], cross(p[1], p[2])) / (a + b + c);
            if (std::fabs(a) + std::fabs(b) + std::fabs(c) == std::fabs(a + b + c) && a + b + c != 0 && t >= 0)
                least = std::min(least, t);
        }
        CHECK((faces[r] < 0) == std::isinf(least) && std::isinf(least) == std::isinf(distances[r]));
        if (faces[r] < 0) continue;
        ++met;
        CHECK(std::fabs(distances[r] - least) < kEnough && static_cast<size_t>(faces[r]) < shape.face_count() / 2);
        CHECK(std::fabs(weights[3 * r] + weights[3 * r + 1] + weights[3 * r + 2] - 1) < kEnough);
    }
    CHECK(met > 50 && met < 500);
    std::vector<int32_t> again(500);
    for (size_t r = 0; r < 500; ++r) {
        const mr_rays one{&origins[3 * r], &ways[3 * r], 1, 1};
        CHECK(mr_tree_cast(tree, &one, &again[r], &distances[r], nullptr) == MR_OK);
    }
    CHECK(again == faces);
    mr_tree_destroy(tree);
}

TEST(trees_refuse_meshes_without_faces_and_faces_out_of_range) {
    Shape shape = tetrahedron();
    mr_tree* tree = nullptr;
    const mr_mesh good = shape.view(), empty{shape.positions.data(), 4, nullptr, 0};
    CHECK(mr_tree_create(&empty, &tree) == MR_BAD_INPUT && mr_tree_create(nullptr, &tree) == MR_BAD_INPUT);
    CHECK(mr_tree_create(&good, &tree) == MR_OK);
    int32_t guess = 4;
    double weights[3];
    CHECK(mr_tree_closest(tree, shape.positions.data(), 1, HUGE_VAL, nullptr, &guess, weights) == MR_BAD_INPUT);
    mr_tree_destroy(tree);
    shape.faces[5] = 4;
    CHECK(mr_tree_create(&good, &tree) == MR_BAD_INPUT);
}
