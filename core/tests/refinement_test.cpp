#include "check.h"
#include "shapes.h"

namespace {

// A sheet, its subdivision and its rows in some frames, each a multiple of the first.
struct Level {
    explicit Level(size_t frames, double bend = 0.0) : shape(sheet(4, bend)), frames(frames) {
        const size_t count = shape.face_count();
        edges.resize(6 * count), finer.resize(12 * count), near.resize(3 * count);
        mr_subdivide(shape.faces.data(), count, shape.vertices(), edges.data(), finer.data(), &edge_count);
        starts.resize(edge_count + 1);
        mr_siblings(finer.data(), count, shape.vertices(), edge_count, starts.data(), near.data());
        rows.resize(3 * frames * all());
        for (size_t k = 0; k < shape.positions.size(); ++k)
            for (size_t t = 0; t < frames; ++t) rows[k * frames + t] = shape.positions[k] * double(t + 1);
        last.resize(edge_count);
    }
    size_t all() const { return shape.vertices() + edge_count; }
    mr_level view(const double* previous = nullptr) const {
        return {frames,       shape.vertices(), shape.faces.data(), shape.face_count(),
                edges.data(), edge_count,       starts.data(),      near.data(),
                previous};
    }

    Shape shape;
    size_t frames, edge_count = 0;
    std::vector<int32_t> edges, finer, near;
    std::vector<int64_t> starts;
    std::vector<double> rows, last;
};

Bytes record_of(uint8_t origin, uint8_t curvature, const Bytes& field) {
    Bytes out{origin, curvature, 36};
    out.insert(out.end(), field.begin(), field.end());
    return out;
}

Bytes symbols_of(std::vector<int32_t> symbols, const Level& level) {
    const size_t links = static_cast<size_t>(level.starts[level.edge_count]);
    const mr_weights weights{symbols.data(), level.edge_count, 1, level.starts.data(), level.near.data(), links};
    Bytes out(2 * symbols.size() + 64);
    size_t size = 0, end = 0;
    CHECK(mr_encode_field(&weights, out.data(), out.size(), &size, &end) == MR_OK);
    out.resize(size);
    return out;
}

const Bytes kNothing = coded_field(0, 0, {}, {});

int decode(const Bytes& record, Level& level, const double* previous = nullptr) {
    const mr_bytes bytes{record.data(), record.size()};
    const mr_level view = level.view(previous);
    return mr_decode_level(&bytes, &view, level.rows.data(), level.last.data());
}

}  // namespace

TEST(new_vertices_of_a_flat_sheet_are_midpoints_whatever_the_curvature) {
    Level level(2);
    CHECK(decode(record_of(0, 255, kNothing), level) == MR_OK);
    for (size_t e = 0; e < level.edge_count; ++e)
        for (size_t k = 0; k < 3; ++k) {
            const double a = level.shape.positions[3 * level.edges[2 * e] + k];
            const double b = level.shape.positions[3 * level.edges[2 * e + 1] + k];
            CHECK(level.rows[(3 * (level.shape.vertices() + e) + k) * 2] == (a + b) / 2);
        }
}

TEST(scalars_of_the_group_before_lift_new_vertices_along_the_normal) {
    Level level(1);
    const std::vector<double> previous(level.edge_count, 0.25);
    CHECK(decode(record_of(1, 0, kNothing), level, previous.data()) == MR_OK);
    for (size_t e = 0; e < level.edge_count; ++e) {
        CHECK(level.rows[3 * (level.shape.vertices() + e) + 2] == 0.25);
        CHECK(level.last[e] == 0.25);
    }
    CHECK(decode(record_of(1, 0, kNothing), level) == MR_NO_PREVIOUS);
}

TEST(the_last_level_is_the_same_as_another_placed) {
    const mr_placement placement{2.0, {1.0, -1.0, 0.5}};
    Level level(3, 0.2);
    const Bytes record = record_of(0, 48, kNothing);
    std::vector<double> shown(level.rows.size()), wanted(shown), plain(shown);
    const mr_frames to{shown.data(), &placement, nullptr}, expected{wanted.data(), &placement, nullptr},
        unplaced{plain.data(), nullptr, nullptr};
    const mr_bytes bytes{record.data(), record.size()};
    const mr_level view = level.view();
    CHECK(mr_decode_last_level(&bytes, &view, level.rows.data(), level.last.data(), &to) == MR_OK);
    CHECK(decode(record, level) == MR_OK);
    CHECK(mr_frames_of_rows(level.rows.data(), 3, level.all(), &expected) == MR_OK && shown == wanted);
    CHECK(mr_frames_of_rows(level.rows.data(), 3, level.all(), &unplaced) == MR_OK);
    for (size_t k = 0; k < plain.size(); ++k) CHECK(shown[k] == placement.origin[k % 3] + 2.0 * plain[k]);
    std::vector<double> scalars(3 * level.edge_count), refined(plain);
    const mr_frames out{refined.data(), nullptr, nullptr};
    CHECK(mr_refine(&view, level.rows.data(), 48, scalars.data(), &out) == MR_OK && refined == plain);
}

TEST(singles_are_the_nearest_floats_of_the_positions) {
    const mr_placement placement{2.0, {1.0, -1.0, 0.5}};
    Level level(3, 0.2);
    std::vector<double> wanted(level.rows.size());
    std::vector<float> singles(wanted.size());
    const mr_frames to{nullptr, &placement, singles.data()}, expected{wanted.data(), &placement, nullptr};
    const Bytes record = record_of(0, 48, kNothing);
    const mr_bytes bytes{record.data(), record.size()};
    const mr_level view = level.view();
    CHECK(mr_decode_last_level(&bytes, &view, level.rows.data(), level.last.data(), &expected) == MR_OK);
    CHECK(mr_decode_last_level(&bytes, &view, level.rows.data(), level.last.data(), &to) == MR_OK);
    for (size_t k = 0; k < wanted.size(); ++k) CHECK(singles[k] == static_cast<float>(wanted[k]));
}

TEST(scalars_of_the_last_frame_are_those_of_the_level) {
    Level level(3);
    const std::vector<int32_t> symbols(level.edge_count, 2);
    const Bytes record = record_of(0, 48, coded_field(1, 8, integers({1, 2, 3}), symbols_of(symbols, level)));
    const mr_bytes bytes{record.data(), record.size()};
    const mr_level view = level.view();
    std::vector<double> alone(level.edge_count);
    CHECK(decode(record, level) == MR_OK && level.last[0] != 0.0);
    CHECK(mr_decode_last_scalars(&bytes, &view, alone.data()) == MR_OK && alone == level.last);
    const Bytes follows = record_of(1, 48, kNothing);
    const mr_bytes lacking{follows.data(), follows.size()};
    CHECK(mr_decode_last_scalars(&lacking, &view, alone.data()) == MR_NO_PREVIOUS);
}

TEST(edge_frames_are_where_refinement_puts_vertices) {
    Level level(1, 0.3);
    std::vector<double> middle(3 * level.edge_count), direction(middle);
    const mr_level view = level.view();
    CHECK(mr_edge_frames(&view, level.shape.positions.data(), 48, middle.data(), direction.data()) == MR_OK);
    CHECK(decode(record_of(0, 48, kNothing), level) == MR_OK);
    for (size_t k = 0; k < middle.size(); ++k) CHECK(level.rows[level.shape.positions.size() + k] == middle[k]);
    const Level two(2);
    const mr_level frames = two.view();
    CHECK(mr_edge_frames(&frames, two.rows.data(), 48, middle.data(), direction.data()) == MR_BAD_INPUT);
}

TEST(hostile_levels_are_refused) {
    Level level(1);
    const Bytes record = record_of(0, 0, kNothing);
    for (size_t size = 0; size < record.size(); ++size)
        CHECK(decode(Bytes(record.begin(), record.begin() + size), level) == MR_BAD_RECORD);
    CHECK(decode(record_of(2, 0, kNothing), level) == MR_BAD_RECORD);
    CHECK(decode(record_of(0, 0, coded_field(2, 0, {}, {})), level) == MR_BAD_COLUMNS);
    Level faces(1), edges(1), siblings(1), none(0);
    faces.shape.faces[0] = 99, edges.edges[0] = -1, siblings.near[0] = 99;
    CHECK(decode(record, faces) == MR_BAD_INPUT && decode(record, edges) == MR_BAD_INPUT);
    CHECK(decode(record, siblings) == MR_NOT_CAUSAL && decode(record, none) == MR_BAD_INPUT);
    const mr_level view = faces.view();
    CHECK(mr_refine(&view, nullptr, 0, nullptr, nullptr) == MR_BAD_INPUT);
    level.rows[3] = NAN;
    std::vector<double> shown(level.rows.size());
    const mr_frames to{shown.data(), nullptr, nullptr};
    CHECK(mr_frames_of_rows(level.rows.data(), 1, level.all(), &to) == MR_NOT_FINITE);
}
