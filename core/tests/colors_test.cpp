#include "meshreel/colors.h"

#include <cmath>

#include "check.h"
#include "shapes.h"

namespace {

const Shape kTetrahedron = tetrahedron();
const mr_mesh kBase = kTetrahedron.view();
const Bytes kNothing = coded_field(0, 0, {}, {});

struct Decoded {
    explicit Decoded(const Bytes& records, int levels = 0, size_t vertices = 4, size_t frames = 2, double chroma = 1.0,
                     const std::vector<double>& before = {})
        : colors(3 * frames * vertices, 99), last(3 * vertices, -99.0) {
        const mr_colored colored{&kBase, levels, vertices, frames, chroma, before.empty() ? nullptr : before.data()};
        const mr_bytes bytes{records.data(), records.size()};
        status = mr_decode_colors(&colored, &bytes, colors.data(), last.data());
    }
    std::vector<uint8_t> colors;
    std::vector<double> last;
    int status;
};

Bytes with_level(uint8_t sibling_weight, const Bytes& field) {
    Bytes records = kNothing;
    records.push_back(sibling_weight);
    records.insert(records.end(), field.begin(), field.end());
    return records;
}

}  // namespace

TEST(vertices_of_which_nothing_is_coded_are_grey) {
    const Decoded found(with_level(24, kNothing), 1, 10);
    CHECK(found.status == MR_OK);
    CHECK(found.colors == std::vector<uint8_t>(60, 128) && found.last == std::vector<double>(30, 0.0));
}

TEST(a_symbol_is_a_step_of_what_its_column_says) {
    mr_hierarchy* hierarchy = nullptr;
    CHECK(mr_hierarchy_create(&kBase, &hierarchy) == MR_OK);
    const mr_graph graph = mr_hierarchy_graph(hierarchy);
    const size_t first = static_cast<size_t>(mr_hierarchy_order(hierarchy)[0]);
    std::vector<int32_t> values{1, 0, 0, 0};
    const mr_weights weights{values.data(), 4, 1, graph.starts, graph.near, static_cast<size_t>(graph.starts[4])};
    Bytes stream(64);
    size_t size = 0, end = 0;
    CHECK(mr_encode_field(&weights, stream.data(), stream.size(), &size, &end) == MR_OK);
    stream.resize(size);
    mr_hierarchy_destroy(hierarchy);
    // Step 2^-2 (level 16), along the axis of luma in the second frame.
    const Decoded found(coded_field(1, 16, integers({0, 1, 0, 0, 0, 0}), stream));
    CHECK(found.status == MR_OK && found.last[3 * first] == 0.25);
    for (size_t v = 0; v < 12; ++v) CHECK(found.colors[v] == 128);
    for (size_t k = 0; k < 3; ++k) CHECK(found.colors[12 + 3 * first + k] == 191);
}

TEST(values_of_the_group_before_are_what_this_one_adds_to) {
    std::vector<double> before(30, 0.0);
    before[0] = 0.25, before[3 * 4] = 0.125;  // luma of a vertex, and of the middle of an edge beyond its ends'
    const Decoded found(with_level(0, kNothing), 1, 10, 2, 1.0, before);
    CHECK(found.status == MR_OK && found.last == before);
    for (size_t frame : {0u, 30u}) {
        CHECK(found.colors[frame] == 191 && found.colors[frame + 2] == 191 && found.colors[frame + 3] == 128);
        CHECK(found.colors[frame + 12] == 191 && found.colors[frame + 15] == 159);  // edges (0, 1) and (0, 2)
    }
}

TEST(values_are_those_of_their_colors) {
    Noise noise(1);
    std::vector<uint8_t> colors(12);
    std::vector<double> values(12);
    for (double chroma : {1.0, 0.25, 3.0})
        for (int run = 0; run < 200; ++run) {
            for (uint8_t& byte : colors) byte = static_cast<uint8_t>(noise.next());
            mr_color_values(colors.data(), 4, chroma, values.data());
            const Decoded found(kNothing, 0, 4, 1, chroma, values);
            CHECK(found.status == MR_OK && found.colors == colors);
        }
}

TEST(values_beyond_all_colors_are_the_nearest_and_no_number_is_black) {
    const Decoded found(kNothing, 0, 4, 1, 1.0, {9, 0, 0, -9, 0, 0, 1e308, 1e308, 1e308, NAN, NAN, NAN});
    CHECK(found.status == MR_OK);
    CHECK(found.colors[0] == 255 && found.colors[3] == 0 && found.colors[9] == 0);
}

TEST(colors_have_one_length_and_are_of_one_mesh) {
    const Bytes records = with_level(24, kNothing);
    for (size_t size = 0; size < records.size(); ++size)
        CHECK(Decoded(Bytes(records.begin(), records.begin() + size), 1, 10).status == MR_BAD_RECORD);
    CHECK(Decoded(with_level(24, {0, 0, 0, 0, 0}), 1, 10).status == MR_BAD_RECORD);
    for (size_t vertices : {0u, 3u, 9u, 11u}) CHECK(Decoded(records, 1, vertices).status == MR_BAD_RECORD);
    CHECK(Decoded(kNothing, 0, 5).status == MR_BAD_RECORD);
}

TEST(colors_without_frames_levels_or_chroma_are_refused) {
    CHECK(Decoded(kNothing, 0, 4, 0).status == MR_BAD_INPUT);
    CHECK(Decoded(kNothing, -1).status == MR_BAD_INPUT);
    for (double chroma : {0.0, -1.0, static_cast<double>(NAN)})
        CHECK(Decoded(kNothing, 0, 4, 1, chroma).status == MR_BAD_INPUT);
}
