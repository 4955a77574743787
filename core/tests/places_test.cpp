#include "meshreel/places.h"

#include <algorithm>

#include "check.h"
#include "shapes.h"

namespace {

struct Coded {
    explicit Coded(const Shape& shape, const std::vector<int32_t>& places)
        : joins(4 * shape.face_count()), starts(6 * shape.face_count()), rests(2 * shape.face_count()) {
        mr_place_symbols symbols{joins.data(), starts.data(), rests.data(), 0, 0, 0};
        const mr_mesh mesh = shape.view();
        status = mr_encode_places(&mesh, places.data(), &symbols);
        joins.resize(symbols.join_count), starts.resize(symbols.start_count), rests.resize(symbols.rest_count);
    }
    int decode(const Shape& shape, std::vector<int32_t>& places) {
        const mr_mesh mesh = shape.view();
        const mr_place_symbols symbols{joins.data(), starts.data(), rests.data(),
                                       joins.size(), starts.size(), rests.size()};
        places.assign(6 * shape.face_count(), -99);
        return mr_decode_places(&mesh, &symbols, places.data());
    }
    std::vector<int32_t> joins, starts, rests;
    int status;
};

// Corners where their vertices are, in hundredths of a unit.
std::vector<int32_t> flat(const Shape& shape) {
    std::vector<int32_t> places;
    for (int32_t v : shape.faces)
        for (size_t k = 0; k < 2; ++k)
            places.push_back(static_cast<int32_t>(100 * shape.positions[3 * static_cast<size_t>(v) + k]));
    return places;
}

void check_come_back(const Shape& shape, const std::vector<int32_t>& places) {
    Coded coded(shape, places);
    std::vector<int32_t> found;
    CHECK(coded.status == MR_OK && coded.decode(shape, found) == MR_OK && found == places);
}

}  // namespace

TEST(places_of_a_flat_sheet_are_one_start_and_no_rests) {
    const Shape shape = sheet(5);
    const Coded coded(shape, flat(shape));
    CHECK(coded.starts.size() == 6 && std::count(coded.joins.begin(), coded.joins.end(), 0) == 0);
    CHECK(std::all_of(coded.rests.begin(), coded.rests.end(), [](int32_t rest) { return rest == 0; }));
    check_come_back(shape, flat(shape));
}

TEST(places_that_nothing_predicts_come_back) {
    Noise noise(1);
    Shape degenerate{std::vector<double>(15, 0.0), {0, 0, 1, 1, 2, 2, 0, 1, 2, 1, 0, 3, 0, 1, 4, 3, 3, 3, 2, 1, 0}};
    for (const Shape& shape : {sheet(6, 0.3), tetrahedron(), degenerate, Shape{}})
        for (int32_t most : {0, 1, 9, 1048575}) {
            std::vector<int32_t> places(6 * shape.face_count());
            for (int32_t& place : places) place = noise.within(most);
            check_come_back(shape, places);
        }
}

TEST(places_have_as_many_symbols_as_their_mesh_needs) {
    const Shape shape = sheet(4);
    std::vector<int32_t> found;
    for (auto stream : {&Coded::joins, &Coded::starts, &Coded::rests}) {
        Coded coded(shape, flat(shape));
        (coded.*stream).push_back(0);
        CHECK(coded.decode(shape, found) == MR_BAD_RECORD);
        for ((coded.*stream).pop_back(); !(coded.*stream).empty();) {
            (coded.*stream).pop_back();
            CHECK(coded.decode(shape, found) == MR_BAD_RECORD);
        }
    }
    Coded other(shape, flat(shape));
    CHECK(other.decode(tetrahedron(), found) == MR_BAD_RECORD);
}

TEST(places_so_far_that_sums_would_not_be_exact_are_refused) {
    const Shape shape = sheet(3);
    for (int32_t far : {1 << 20, -(1 << 20), INT32_MAX, INT32_MIN}) {
        std::vector<int32_t> places = flat(shape), found;
        Coded coded(shape, places);
        coded.starts[0] = far;
        CHECK(coded.decode(shape, found) == MR_BAD_RECORD);
        places[1] = far;
        CHECK(Coded(shape, places).status == MR_BAD_INPUT);
    }
}

TEST(faces_of_other_vertices_have_no_places) {
    Shape shape = sheet(3);
    Coded coded(shape, flat(shape));
    std::vector<int32_t> found;
    for (int32_t wrong : {-1, 9}) {
        shape.faces[4] = wrong;
        CHECK(coded.decode(shape, found) == MR_BAD_INPUT);
        CHECK(Coded(shape, std::vector<int32_t>(6 * shape.face_count())).status == MR_BAD_INPUT);
    }
}
