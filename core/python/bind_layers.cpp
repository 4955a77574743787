#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <optional>
#include <tuple>
#include <vector>

#include "arrays.h"
#include "meshreel/colors.h"
#include "meshreel/entropy.h"
#include "meshreel/layers.h"
#include "meshreel/places.h"

namespace meshreel {
namespace {

using namespace nb::literals;

nb::tuple hierarchy(In<double, 2> positions, In<int32_t, 2> faces) {
    const mr_mesh mesh = mesh_of(positions, faces);
    mr_hierarchy* made = nullptr;
    check(without_gil([&] { return mr_hierarchy_create(&mesh, &made); }));
    const std::unique_ptr<mr_hierarchy, void (*)(mr_hierarchy*)> owner(made, mr_hierarchy_destroy);
    const mr_graph graph = mr_hierarchy_graph(made);
    const size_t count = graph.count, links = static_cast<size_t>(graph.starts[count]);
    return nb::make_tuple(Buffer<int32_t>(mr_hierarchy_order(made), count).shaped(count),
                          Buffer<int64_t>(graph.starts, count + 1).shaped(count + 1),
                          Buffer<int32_t>(graph.near, links).shaped(links),
                          Buffer<double>(graph.weights, links).shaped(links));
}

void check_links(const In<int64_t, 1>& starts, const In<int32_t, 1>& near) {
    expect(starts.shape(0) > 0 && starts.data()[0] == 0);
    const size_t count = starts.shape(0) - 1;
    for (size_t v = 0; v < count; ++v) expect(starts.data()[v] <= starts.data()[v + 1]);
    expect(starts.data()[count] == static_cast<int64_t>(near.shape(0)));
}

// A causal graph and the arrays that it looks at.
struct Graph {
    Graph(In<int64_t, 1> starts, In<int32_t, 1> near, In<double, 1> weights)
        : starts(starts), near(near), weights(weights) {
        check_links(starts, near);
        expect(weights.shape(0) == near.shape(0));
    }
    size_t count() const { return starts.shape(0) - 1; }
    mr_graph view() const { return {count(), starts.data(), near.data(), weights.data()}; }
    mr_weights symbols(int32_t* first, size_t columns) const {
        return {first, count(), columns, starts.data(), near.data(), near.shape(0)};
    }

    In<int64_t, 1> starts;
    In<int32_t, 1> near;
    In<double, 1> weights;
};

nb::tuple predict_forward(In<double, 2> values, const Graph& graph, double step, double price) {
    const size_t columns = values.shape(0), count = values.shape(1);
    expect(count == graph.count());
    const mr_graph view = graph.view();
    Buffer<int32_t> symbols(columns * count);
    Buffer<double> decoded(columns * count);
    check(without_gil([&] {
        return mr_predict_forward(&view, values.data(), columns, step, price, symbols.data(), decoded.data());
    }));
    return nb::make_tuple(symbols.shaped(columns, count), decoded.shaped(columns, count));
}

// The metric of a surface and the arrays that it looks at.
struct Surface {
    Surface(In<double, 2> vectors, In<double, 2> normals, double tangential)
        : vectors(vectors), normals(normals), tangential(tangential) {
        expect(normals.shape(1) == vectors.shape(1) && vectors.shape(1) % 3 == 0);
    }
    mr_surface view() const { return {vectors.shape(0), vectors.shape(1), vectors.data(), normals.data(), tangential}; }

    In<double, 2> vectors, normals;
    double tangential;
};

nb::tuple predict_surface(In<double, 2> values, const Graph& graph, const Surface& surface, double step, double price) {
    const size_t columns = values.shape(0), count = values.shape(1);
    const mr_surface metric = surface.view();
    expect(count == graph.count() && metric.columns == columns && surface.normals.shape(0) == count);
    const mr_graph view = graph.view();
    Buffer<int32_t> symbols(columns * count);
    Buffer<double> decoded(columns * count);
    check(without_gil([&] {
        return mr_predict_surface(&view, &metric, values.data(), step, price, symbols.data(), decoded.data());
    }));
    return nb::make_tuple(symbols.shaped(columns, count), decoded.shaped(columns, count));
}

// The stream, and the bytes of it that each column takes.
nb::tuple encode_field(InOut<int32_t, 2> symbols, const Graph& graph) {
    expect(symbols.shape(1) == graph.count());
    const mr_weights weights = graph.symbols(symbols.data(), symbols.shape(0));
    std::vector<uint8_t> bytes(2 * symbols.size() + 16);
    std::vector<size_t> ends(weights.columns);
    size_t size = 0;
    int status = mr_encode_field(&weights, bytes.data(), bytes.size(), &size, ends.data());
    if (status == MR_OUT_TOO_SMALL) {
        bytes.resize(size);
        status = mr_encode_field(&weights, bytes.data(), bytes.size(), &size, ends.data());
    }
    check(status);
    Buffer<int64_t> sizes(weights.columns);
    for (size_t c = 0; c < weights.columns; ++c) {
        sizes.data()[c] = static_cast<int64_t>(ends[c] - (c > 0 ? ends[c - 1] : 0));
    }
    return nb::make_tuple(nb::bytes(bytes.data(), size), sizes.shaped(weights.columns));
}

Out<double, 2> decode_field(const nb::bytes& record, const Graph& graph, size_t width, size_t head) {
    const mr_bytes bytes = bytes_of(record);
    const mr_graph nodes = graph.view();
    expect(head <= INT32_MAX);
    Buffer<double> rows(graph.count() * width);
    check_decoded(without_gil([&] { return mr_decode_field(&bytes, &nodes, width, head, rows.data()); }));
    return rows.shaped(graph.count(), width);
}

Out<double, 3> decode_motion(const nb::bytes& record, In<double, 2> positions, In<int32_t, 2> faces, size_t frames) {
    const mr_bytes bytes = bytes_of(record);
    const mr_mesh base = mesh_of(positions, faces);
    expect(frames <= UINT8_MAX);
    Buffer<double> rows(3 * frames * base.vertices);
    check_decoded(without_gil([&] { return mr_decode_motion(&bytes, &base, frames, rows.data()); }));
    return rows.shaped(base.vertices, 3, frames);
}

Out<double, 2> orthonormal_inverse(In<int32_t, 1> symbols, size_t count, size_t width) {
    expect(count <= width && symbols.shape(0) == count * width - count * (count > 0 ? count - 1 : 0) / 2);
    Buffer<double> vectors(count * width);
    check(mr_orthonormal_inverse(symbols.data(), count, width, vectors.data()));
    return vectors.shaped(count, width);
}

nb::tuple subdivide(In<int32_t, 2> faces, size_t vertices) {
    expect(faces.shape(1) == 3);
    const size_t face_count = faces.shape(0);
    Buffer<int32_t> edges(6 * face_count), finer(12 * face_count);
    size_t count = 0;
    check(without_gil(
        [&] { return mr_subdivide(faces.data(), face_count, vertices, edges.data(), finer.data(), &count); }));
    return nb::make_tuple(edges.shaped(count, 2), finer.shaped(4 * face_count, 3));
}

nb::tuple siblings(In<int32_t, 2> finer, size_t vertices, size_t edge_count) {
    expect(finer.shape(1) == 3 && finer.shape(0) % 4 == 0);
    const size_t face_count = finer.shape(0) / 4;
    Buffer<int64_t> starts(edge_count + 1);
    Buffer<int32_t> near(3 * face_count);
    check(without_gil(
        [&] { return mr_siblings(finer.data(), face_count, vertices, edge_count, starts.data(), near.data()); }));
    const size_t links = static_cast<size_t>(starts.data()[edge_count]);
    return nb::make_tuple(starts.shaped(edge_count + 1), near.shaped(links));
}

// The connectivity of a level and the arrays that it looks at.
struct Level {
    Level(In<int32_t, 2> faces, In<int32_t, 2> edges, In<int64_t, 1> starts, In<int32_t, 1> near)
        : faces(faces), edges(edges), starts(starts), near(near) {
        check_links(starts, near);
        expect(faces.shape(1) == 3 && edges.shape(1) == 2 && starts.shape(0) == edges.shape(0) + 1);
    }
    size_t edge_count() const { return edges.shape(0); }

    In<int32_t, 2> faces, edges;
    In<int64_t, 1> starts;
    In<int32_t, 1> near;
};

using Previous = std::optional<In<double, 1>>;  // scalars in the last frame of the group before

mr_level view(const Level& level, const In<double, 3>& rows, const Previous& previous) {
    expect(rows.shape(1) == 3);
    const bool has_previous = previous && previous->shape(0) == level.edge_count();
    return {rows.shape(2),        rows.shape(0),      level.faces.data(),
            level.faces.shape(0), level.edges.data(), level.edge_count(),
            level.starts.data(),  level.near.data(),  has_previous ? previous->data() : nullptr};
}

// The connectivity alone, for the encoder.
mr_level view(size_t frames, size_t vertices, const In<int32_t, 2>& faces, const In<int32_t, 2>& edges) {
    expect(faces.shape(1) == 3 && edges.shape(1) == 2);
    return {frames, vertices, faces.data(), faces.shape(0), edges.data(), edges.shape(0), nullptr, nullptr, nullptr};
}

nb::tuple edge_frames(In<double, 2> positions, In<int32_t, 2> faces, In<int32_t, 2> edges, int curvature) {
    expect(positions.shape(1) == 3);
    const mr_level level = view(1, positions.shape(0), faces, edges);
    Buffer<double> midpoints(3 * level.edge_count), directions(3 * level.edge_count);
    check(without_gil(
        [&] { return mr_edge_frames(&level, positions.data(), curvature, midpoints.data(), directions.data()); }));
    return nb::make_tuple(midpoints.shaped(level.edge_count, 3), directions.shaped(level.edge_count, 3));
}

using Place = std::optional<std::tuple<double, std::tuple<double, double, double>>>;  // scale and origin

// Destination of frames, and their placement.
class Target {
public:
    Target(double* positions, const Place& place) : Target(positions, nullptr, place) {}
    Target(float* positions, const Place& place) : Target(nullptr, positions, place) {}
    Target(const Target&) = delete;
    const mr_frames* get() const { return &frames_; }

private:
    Target(double* positions, float* singles, const Place& place)
        : frames_{positions, place ? &placement_ : nullptr, singles} {
        if (!place) return;
        const auto& [scale, origin] = *place;
        placement_ = {scale, {std::get<0>(origin), std::get<1>(origin), std::get<2>(origin)}};
    }

    mr_placement placement_{};
    mr_frames frames_;
};

// The finer level's places of V x 3 x T rows and E x T scalars: T x (V + E) x 3.
Out<double, 3> refine(In<double, 3> rows, In<int32_t, 2> faces, In<int32_t, 2> edges, In<double, 2> scalars,
                      int curvature) {
    const size_t vertices = rows.shape(0), frames = rows.shape(2), count = edges.shape(0);
    expect(rows.shape(1) == 3 && scalars.shape(0) == count && scalars.shape(1) == frames);
    const mr_level level = view(frames, vertices, faces, edges);
    Buffer<double> positions(3 * frames * (vertices + count));
    check_decoded(without_gil(
        [&] { return mr_refine(&level, rows.data(), curvature, scalars.data(), Target(positions.data(), {}).get()); }));
    return positions.shaped(frames, vertices + count, 3);
}

// Rows of the finer level, and the last frame's scalars.
nb::tuple decode_level(const nb::bytes& record, const Level& level, In<double, 3> rows, Previous previous) {
    const mr_bytes bytes = bytes_of(record);
    const mr_level shape = view(level, rows, previous);
    const size_t count = shape.vertices + shape.edge_count;
    Buffer<double> finer(3 * shape.frames * count), last(shape.edge_count);
    std::copy(rows.data(), rows.data() + rows.size(), finer.data());
    check_decoded(without_gil([&] { return mr_decode_level(&bytes, &shape, finer.data(), last.data()); }));
    return nb::make_tuple(finer.shaped(count, 3, shape.frames), last.shaped(shape.edge_count));
}

// Fills T x (V + E) x 3 positions. Returns the last frame's scalars.
template <class Number>
Out<double, 1> decode_last_level(const nb::bytes& record, const Level& level, In<double, 3> rows, Previous previous,
                                 Place place, InOut<Number, 3> positions) {
    const mr_bytes bytes = bytes_of(record);
    const mr_level shape = view(level, rows, previous);
    expect(positions.shape(0) == shape.frames && positions.shape(1) == shape.vertices + shape.edge_count);
    expect(positions.shape(2) == 3);
    Buffer<double> last(shape.edge_count);
    const Target target(positions.data(), place);
    check_decoded(
        without_gil([&] { return mr_decode_last_level(&bytes, &shape, rows.data(), last.data(), target.get()); }));
    return last.shaped(shape.edge_count);
}

// Copies the faces of which `dropped` is 0 to the beginning of `room`. Returns their number.
size_t keep_faces(In<int32_t, 2> faces, In<uint8_t, 1> dropped, InOut<int32_t, 2> room) {
    const size_t count = faces.shape(0);
    expect(faces.shape(1) == 3 && room.shape(1) == 3 && dropped.shape(0) == count && room.shape(0) >= count);
    return mr_keep_faces(faces.data(), dropped.data(), count, room.data());
}

// Colours frames x vertices x 3, and the values of the last frame.
nb::tuple decode_colors(nb::bytes records, In<double, 2> positions, In<int32_t, 2> faces, int levels, size_t vertices,
                        size_t frames, double chroma, std::optional<In<double, 2>> before) {
    const mr_mesh base = mesh_of(positions, faces);
    expect(!before || (before->shape(0) == vertices && before->shape(1) == 3));
    const mr_colored colored{&base, levels, vertices, frames, chroma, before ? before->data() : nullptr};
    Buffer<uint8_t> colors(3 * frames * vertices);
    Buffer<double> last(3 * vertices);
    const mr_bytes bytes = bytes_of(records);
    check_decoded(without_gil([&] { return mr_decode_colors(&colored, &bytes, colors.data(), last.data()); }));
    return nb::make_tuple(colors.shaped(frames, vertices, 3), last.shaped(vertices, 3));
}

// Joins, starts and rests of the places of corners, faces x 3 x 2.
nb::tuple encode_places(In<double, 2> positions, In<int32_t, 2> faces, In<int32_t, 3> places) {
    const mr_mesh mesh = mesh_of(positions, faces);
    expect(places.shape(0) == mesh.face_count && places.shape(1) == 3 && places.shape(2) == 2);
    Buffer<int32_t> joins(4 * mesh.face_count), starts(6 * mesh.face_count), rests(2 * mesh.face_count);
    mr_place_symbols symbols{joins.data(), starts.data(), rests.data(), 0, 0, 0};
    check(mr_encode_places(&mesh, places.data(), &symbols));
    const size_t counts[] = {symbols.join_count, symbols.start_count, symbols.rest_count};
    return nb::make_tuple(Buffer<int32_t>(joins.data(), counts[0]).shaped(counts[0]),
                          Buffer<int32_t>(starts.data(), counts[1]).shaped(counts[1]),
                          Buffer<int32_t>(rests.data(), counts[2]).shaped(counts[2]));
}

Out<int32_t, 3> decode_places(In<double, 2> positions, In<int32_t, 2> faces, InOut<int32_t, 1> joins,
                              InOut<int32_t, 1> starts, InOut<int32_t, 1> rests) {
    const mr_mesh mesh = mesh_of(positions, faces);
    const mr_place_symbols symbols{joins.data(),   starts.data(),   rests.data(),
                                   joins.shape(0), starts.shape(0), rests.shape(0)};
    Buffer<int32_t> places(6 * mesh.face_count);
    check_decoded(without_gil([&] { return mr_decode_places(&mesh, &symbols, places.data()); }));
    return places.shaped(mesh.face_count, 3, 2);
}

Out<double, 2> color_values(In<uint8_t, 2> colors, double chroma) {
    const size_t count = colors.shape(0);
    expect(colors.shape(1) == 3);
    Buffer<double> values(3 * count);
    mr_color_values(colors.data(), count, chroma, values.data());
    return values.shaped(count, 3);
}

}  // namespace

// Arrays that are written to are bound with .noconvert(): a converted copy would leave the caller's array as it was.
void bind_layers(nb::module_& m) {
    nb::class_<Graph>(m, "Graph")
        .def(nb::init<In<int64_t, 1>, In<int32_t, 1>, In<double, 1>>(), "starts"_a, "near"_a, "weights"_a);
    nb::class_<Surface>(m, "Surface")
        .def(nb::init<In<double, 2>, In<double, 2>, double>(), "vectors"_a, "normals"_a, "tangential"_a);
    nb::class_<Level>(m, "Level")
        .def(nb::init<In<int32_t, 2>, In<int32_t, 2>, In<int64_t, 1>, In<int32_t, 1>>(), "faces"_a, "edges"_a,
             "starts"_a, "near"_a);
    m.def("hierarchy", &hierarchy);
    m.def("predict_forward", &predict_forward);
    m.def("predict_surface", &predict_surface);
    m.def("orthonormal_inverse", &orthonormal_inverse);
    m.def("subdivide", &subdivide);
    m.def("siblings", &siblings);
    m.def("edge_frames", &edge_frames);
    m.def("refine", &refine);
    m.def("encode_field", &encode_field);
    m.def("decode_field", &decode_field);
    m.def("decode_motion", &decode_motion);
    m.def("decode_level", &decode_level, "record"_a, "level"_a, "rows"_a, "previous"_a.none());
    m.def("decode_last_level", &decode_last_level<double>, "record"_a, "level"_a, "rows"_a, "previous"_a.none(),
          "place"_a.none(), "positions"_a.noconvert());
    m.def("decode_last_level", &decode_last_level<float>, "record"_a, "level"_a, "rows"_a, "previous"_a.none(),
          "place"_a.none(), "positions"_a.noconvert());
    m.def("decode_colors", &decode_colors, "records"_a, "vertices"_a, "faces"_a, "levels"_a, "count"_a, "frames"_a,
          "chroma"_a, "before"_a.none());
    m.def("color_values", &color_values);
    m.def("encode_places", &encode_places);
    m.def("decode_places", &decode_places);
    m.def("keep_faces", &keep_faces, "faces"_a, "dropped"_a, "room"_a.noconvert());
}

}  // namespace meshreel
