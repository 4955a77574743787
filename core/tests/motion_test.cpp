#include <cmath>

#include "check.h"
#include "shapes.h"

namespace {

// A LayersGroup record (FORMAT.md) of two frames without a base mesh.
Bytes group(const Bytes& motion, uint8_t shared, uint8_t form = 2, uint8_t origin = 0) {
    Bytes out{form, origin, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, shared};
    out.insert(out.end(), motion.begin(), motion.end());
    return out;
}

int decode(const Bytes& record, const Shape& base, size_t frames, std::vector<double>& rows) {
    const mr_bytes bytes{record.data(), record.size()};
    const mr_mesh mesh = base.view();
    rows.assign(3 * frames * base.vertices(), -99.0);
    return mr_decode_motion(&bytes, &mesh, frames, rows.data());
}

const Bytes kMean = coded_field(0, 0, integers({1, 2, 4, 6, 8, 10, 12}), {});

}  // namespace

TEST(a_motion_without_columns_moves_all_vertices_by_the_mean) {
    const Shape base = tetrahedron();
    std::vector<double> rows;
    CHECK(decode(group(kMean, 1), base, 2, rows) == MR_OK);
    for (size_t v = 0; v < 4; ++v)
        for (size_t k = 0; k < 3; ++k)
            for (size_t t = 0; t < 2; ++t)
                CHECK(rows[(3 * v + k) * 2 + t] == base.positions[3 * v + k] + 1 + k + 3 * t);
}

TEST(poses_turn_a_base_about_its_middle_and_shift_it_each_from_the_pose_before) {
    Shape base = tetrahedron();
    // with one bit: shifts by (.5, 0, 0) twice; turns about z by 90 degrees (the tangent of half is 1, so 2) twice
    const Bytes poses = coded_field(0, 0, integers({1, 1, 0, 0, 1, 0, 0, 0, 0, 4, 0, 0, 4}), {});
    std::vector<double> rows;
    CHECK(decode(group(poses, 2), base, 2, rows) == MR_OK);
    double middle[3] = {0, 0, 0};
    for (size_t v = 0; v < 4; ++v)
        for (size_t k = 0; k < 3; ++k) middle[k] += base.positions[3 * v + k] / 4;
    for (size_t v = 0; v < 4; ++v) {
        const double x = base.positions[3 * v] - middle[0], y = base.positions[3 * v + 1] - middle[1];
        const double wanted[2][3] = {{-y + middle[0] + 0.5, x + middle[1], base.positions[3 * v + 2]},
                                     {-x + middle[0] + 1.0, -y + middle[1], base.positions[3 * v + 2]}};
        for (size_t t = 0; t < 2; ++t)
            for (size_t k = 0; k < 3; ++k) CHECK(std::fabs(rows[(3 * v + k) * 2 + t] - wanted[t][k]) < 1e-12);
    }
    CHECK(decode(group(kMean, 2), base, 2, rows) == MR_BAD_BASIS);
    for (int bits : {-1, 31}) {
        const Bytes wrong = coded_field(0, 0, integers({bits, 0, 0, 0, 0, 0, 0}), {});
        CHECK(decode(group(wrong, 1), base, 2, rows) == MR_BAD_SHARED);
    }
}

TEST(places_of_the_last_frame_are_those_of_the_motion) {
    const Shape base = tetrahedron();
    const Bytes record = group(kMean, 1);
    const mr_bytes bytes{record.data(), record.size()};
    const mr_mesh mesh = base.view();
    std::vector<double> rows, last(12);
    CHECK(decode(record, base, 2, rows) == MR_OK);
    CHECK(mr_decode_last_places(&bytes, &mesh, 2, last.data()) == MR_OK);
    for (size_t k = 0; k < last.size(); ++k) CHECK(last[k] == rows[2 * k + 1]);
    CHECK(mr_decode_last_places(&bytes, &mesh, 3, last.data()) == MR_BAD_RECORD);
    Bytes none = record;
    none[2] = 0;
    const mr_bytes frameless{none.data(), none.size()};
    CHECK(mr_decode_last_places(&frameless, &mesh, 0, last.data()) == MR_BAD_RECORD);
}

TEST(a_motion_record_has_one_length_and_form_and_number_of_frames) {
    const Bytes record = group(kMean, 1);
    std::vector<double> rows;
    for (size_t size = 0; size < record.size(); ++size)
        CHECK(decode(Bytes(record.begin(), record.begin() + size), tetrahedron(), 2, rows) == MR_BAD_RECORD);
    CHECK(decode(record, tetrahedron(), 3, rows) == MR_BAD_RECORD);
    CHECK(decode(group(kMean, 1, 3), tetrahedron(), 2, rows) == MR_BAD_RECORD);
    CHECK(decode(group(kMean, 3), tetrahedron(), 2, rows) == MR_BAD_RECORD);
    CHECK(decode(group(kMean, 1, 2, 2), tetrahedron(), 2, rows) == MR_BAD_RECORD);
}

TEST(a_base_mesh_that_names_no_vertex_or_is_not_finite_is_refused) {
    Shape base = tetrahedron();
    std::vector<double> rows;
    base.faces[4] = 4;
    CHECK(decode(group(kMean, 1), base, 2, rows) == MR_BAD_INPUT);
    base = tetrahedron();
    base.positions[5] = INFINITY;
    CHECK(decode(group(kMean, 1), base, 2, rows) == MR_NOT_FINITE);
    CHECK(decode(group(coded_field(9, 0, {}, {}), 0), tetrahedron(), 2, rows) == MR_BAD_COLUMNS);
}
