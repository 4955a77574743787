#include "check.h"
#include "shapes.h"

namespace {

struct Finer {
    explicit Finer(const Shape& shape) : edges(6 * shape.face_count()), faces(12 * shape.face_count()) {
        status =
            mr_subdivide(shape.faces.data(), shape.face_count(), shape.vertices(), edges.data(), faces.data(), &count);
    }
    std::vector<int32_t> edges, faces;
    size_t count = 0;
    int status;
};

}  // namespace

TEST(a_tetrahedron_has_six_sorted_edges_and_faces_keep_their_corners) {
    const Finer finer(tetrahedron());
    CHECK(finer.status == MR_OK && finer.count == 6);
    CHECK(std::vector<int32_t>(finer.edges.begin(), finer.edges.begin() + 12) ==
          (std::vector<int32_t>{0, 1, 0, 2, 0, 3, 1, 2, 1, 3, 2, 3}));
    CHECK(std::vector<int32_t>(finer.faces.begin(), finer.faces.begin() + 12) ==
          (std::vector<int32_t>{0, 5, 4, 5, 2, 7, 4, 7, 1, 5, 7, 4}));
}

TEST(a_vertex_with_many_edges_is_sorted_too) {
    Shape fan{std::vector<double>(3 * 40), {}};
    for (int32_t v = 38; v > 0; --v) fan.faces.insert(fan.faces.end(), {0, v, v + 1});
    const Finer finer(fan);
    CHECK(finer.status == MR_OK && finer.count == 39 + 38);
    for (size_t e = 1; e < 39; ++e) CHECK(finer.edges[2 * e + 1] == finer.edges[2 * e - 1] + 1);
}

TEST(siblings_share_a_face_and_come_before) {
    const Finer finer(tetrahedron());
    std::vector<int64_t> starts(7);
    std::vector<int32_t> near(12);
    CHECK(mr_siblings(finer.faces.data(), 4, 4, 6, starts.data(), near.data()) == MR_OK);
    CHECK(starts == (std::vector<int64_t>{0, 0, 1, 3, 5, 8, 12}));  // all edges but the opposite ones
    CHECK(std::vector<int32_t>(near.begin() + 5, near.begin() + 8) == (std::vector<int32_t>{0, 2, 3}));
}

TEST(faces_and_counts_out_of_range_are_refused) {
    Shape shape = tetrahedron();
    for (int32_t corner : {-1, 4}) {
        shape.faces[2] = corner;
        CHECK(Finer(shape).status == MR_BAD_INPUT);
    }
    size_t count = 0;
    CHECK(mr_subdivide(nullptr, 0, size_t{1} << 31, nullptr, nullptr, &count) == MR_BAD_INPUT);
    CHECK(mr_siblings(nullptr, 0, 0, size_t{1} << 31, nullptr, nullptr) == MR_BAD_INPUT);
    Finer finer(tetrahedron());
    std::vector<int64_t> starts(7);
    std::vector<int32_t> near(12);
    for (int32_t corner : {3, 10}) {
        finer.faces[9] = corner;
        CHECK(mr_siblings(finer.faces.data(), 4, 4, 6, starts.data(), near.data()) == MR_BAD_INPUT);
    }
}

TEST(kept_faces_are_those_that_are_not_dropped) {
    Noise noise(11);
    const Shape shape = sheet(9);
    for (int round = 0; round < 50; ++round) {
        Bytes dropped(shape.face_count());
        std::vector<int32_t> wanted, kept(shape.faces.size());
        for (size_t f = 0; f < dropped.size(); ++f) {
            dropped[f] = f > 0 && noise.next() % 16 > 0 ? dropped[f - 1] : noise.next() % 2;
            for (size_t k = 0; k < 3 && !dropped[f]; ++k) wanted.push_back(shape.faces[3 * f + k]);
        }
        kept.resize(3 * mr_keep_faces(shape.faces.data(), dropped.data(), dropped.size(), kept.data()));
        CHECK(kept == wanted);
    }
}
