#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "meshreel/field_coder.h"
#include "meshreel/layers.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

template <class T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using InOut = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using Out = nb::ndarray<nb::numpy, T, nb::ndim<N>>;

template <class T>
struct Buffer {
    explicit Buffer(size_t count) : owned(new T[count]) {}
    Buffer(const T* from, size_t count) : Buffer(count) {
        if (count > 0) std::memcpy(owned.get(), from, count * sizeof(T));
    }
    T* data() { return owned.get(); }
    nb::capsule release() {
        return nb::capsule(owned.release(), [](void* p) noexcept { delete[] static_cast<T*>(p); });
    }
    Out<T, 1> one(size_t n) {
        T* p = data();
        return Out<T, 1>(p, {n}, release());
    }
    Out<T, 2> two(size_t n, size_t m) {
        T* p = data();
        return Out<T, 2>(p, {n, m}, release());
    }
    Out<T, 3> three(size_t n, size_t m, size_t l) {
        T* p = data();
        return Out<T, 3>(p, {n, m, l}, release());
    }
    std::unique_ptr<T[]> owned;
};

void check(int status) {
    if (status == MR_LAYERS_NO_MEMORY) throw std::bad_alloc();
    if (status == MR_LAYERS_OVERFLOW) throw nb::value_error("a symbol beyond 32 bits");
    if (status != MR_LAYERS_OK) throw nb::value_error("an index is out of range, or the graph is not causal");
}

void expect(bool fits) {
    if (!fits) throw nb::value_error("array sizes do not fit");
}

nb::tuple hierarchy(In<double, 2> positions, In<int32_t, 2> faces) {
    expect(positions.shape(1) == 3 && faces.shape(1) == 3);
    mr_hierarchy* made = nullptr;
    check(mr_hierarchy_create(positions.data(), positions.shape(0), faces.data(), faces.shape(0), &made));
    const std::unique_ptr<mr_hierarchy, void (*)(mr_hierarchy*)> owner(made, mr_hierarchy_destroy);
    const mr_graph graph = mr_hierarchy_graph(made);
    const size_t count = graph.count, links = static_cast<size_t>(graph.starts[count]);
    return nb::make_tuple(Buffer<int32_t>(mr_hierarchy_order(made), count).one(count), Buffer<int64_t>(graph.starts, count + 1).one(count + 1),
                          Buffer<int32_t>(graph.near, links).one(links), Buffer<double>(graph.weights, links).one(links));
}

mr_graph graph_of(const In<int64_t, 1>& starts, const In<int32_t, 1>& near, const In<double, 1>& weights, size_t count) {
    expect(starts.shape(0) == count + 1 && near.shape(0) == weights.shape(0));
    expect(starts.data()[count] == static_cast<int64_t>(near.shape(0)));
    for (size_t v = 0; v < count; ++v) expect(starts.data()[v] <= starts.data()[v + 1]);
    return {count, starts.data(), near.data(), weights.data()};
}

nb::tuple predict_forward(In<double, 2> values, In<int64_t, 1> starts, In<int32_t, 1> near, In<double, 1> weights, double step,
                          double price) {
    const size_t columns = values.shape(0), count = values.shape(1);
    const mr_graph graph = graph_of(starts, near, weights, count);
    Buffer<int32_t> symbols(columns * count);
    Buffer<double> decoded(columns * count);
    check(mr_predict_forward(&graph, values.data(), columns, step, price, symbols.data(), decoded.data()));
    return nb::make_tuple(symbols.two(columns, count), decoded.two(columns, count));
}

nb::tuple predict_surface(In<double, 2> values, nb::tuple graph_arrays, In<double, 2> vectors, In<double, 2> normals, double tangential,
                          double step, double price) {
    const size_t columns = values.shape(0), count = values.shape(1), width = vectors.shape(1);
    expect(graph_arrays.size() == 3 && vectors.shape(0) == columns && normals.shape(0) == count && normals.shape(1) == width && width % 3 == 0);
    const auto starts = nb::cast<In<int64_t, 1>>(graph_arrays[0]);
    const auto near = nb::cast<In<int32_t, 1>>(graph_arrays[1]);
    const auto weights = nb::cast<In<double, 1>>(graph_arrays[2]);
    const mr_graph graph = graph_of(starts, near, weights, count);
    const mr_surface surface{columns, width, vectors.data(), normals.data(), tangential};
    Buffer<int32_t> symbols(columns * count);
    Buffer<double> decoded(columns * count);
    check(mr_predict_surface(&graph, &surface, values.data(), step, price, symbols.data(), decoded.data()));
    return nb::make_tuple(symbols.two(columns, count), decoded.two(columns, count));
}

// A field's arrays, as Python has them: symbols, graph, step, vectors, means and what values are counted from, or None.
struct Field {
    explicit Field(const nb::tuple& arrays)
        : symbols(item<In<int32_t, 2>>(arrays, 0)), graph(item<nb::tuple>(arrays, 1)), step(item<double>(arrays, 2)),
          vectors(item<In<double, 2>>(arrays, 3)), means(item<In<double, 1>>(arrays, 4)) {
        expect(graph.size() == 3 && vectors.shape(0) == symbols.shape(0) && means.shape(0) == vectors.shape(1));
        starts = item<In<int64_t, 1>>(graph, 0), near = item<In<int32_t, 1>>(graph, 1), weights = item<In<double, 1>>(graph, 2);
        if (arrays[5].is_none()) return;
        before = item<In<double, 1>>(arrays, 5);
        expect(before.shape(0) == count());
    }
    size_t count() const { return symbols.shape(1); }
    size_t width() const { return vectors.shape(1); }
    mr_field view() const {
        const mr_basis basis{symbols.shape(0), width(), vectors.data(), means.data()};
        return {graph_of(starts, near, weights, count()), basis, symbols.data(), step, before.is_valid() ? before.data() : nullptr};
    }

    template <class T>
    static T item(const nb::tuple& arrays, size_t k) {
        expect(k < arrays.size());
        return nb::cast<T>(arrays[k]);
    }

    In<int32_t, 2> symbols;
    nb::tuple graph;
    double step;
    In<double, 2> vectors;
    In<double, 1> means, before;
    In<int64_t, 1> starts;
    In<int32_t, 1> near;
    In<double, 1> weights;
};

// A row for each value.
Out<double, 2> field_inverse(nb::tuple field) {
    const Field arrays(field);
    const mr_field view = arrays.view();
    Buffer<double> rows(arrays.count() * arrays.width());
    check(mr_field_inverse(&view, rows.data()));
    return rows.two(arrays.count(), arrays.width());
}

Out<double, 2> orthonormal_inverse(In<int32_t, 1> symbols, size_t count, size_t width) {
    expect(count <= width && symbols.shape(0) == count * width - count * (count > 0 ? count - 1 : 0) / 2);
    Buffer<double> vectors(count * width);
    check(mr_orthonormal_inverse(symbols.data(), count, width, vectors.data()));
    return vectors.two(count, width);
}

// V x 3 x T rows, and whether all of it is finite.
nb::tuple place_rows(In<double, 2> moved, In<int32_t, 1> order, In<double, 2> base) {
    const size_t vertices = moved.shape(0), frames = moved.shape(1) / 3;
    expect(moved.shape(1) == 3 * frames && order.shape(0) == vertices && base.shape(0) == vertices && base.shape(1) == 3);
    for (size_t p = 0; p < vertices; ++p) expect(order.data()[p] >= 0 && static_cast<size_t>(order.data()[p]) < vertices);
    Buffer<double> rows(3 * frames * vertices);
    const bool finite = mr_place_rows(moved.data(), order.data(), base.data(), vertices, frames, rows.data()) != 0;
    return nb::make_tuple(rows.three(vertices, 3, frames), finite);
}

nb::tuple subdivide(In<int32_t, 2> faces, size_t vertices) {
    expect(faces.shape(1) == 3);
    const size_t face_count = faces.shape(0);
    Buffer<int32_t> edges(6 * face_count), finer(12 * face_count);
    size_t count = 0;
    check(mr_subdivide(faces.data(), face_count, vertices, edges.data(), finer.data(), &count));
    return nb::make_tuple(edges.two(count, 2), finer.two(4 * face_count, 3));
}

nb::tuple siblings(In<int32_t, 2> finer, size_t vertices, size_t edge_count) {
    expect(finer.shape(1) == 3 && finer.shape(0) % 4 == 0);
    const size_t face_count = finer.shape(0) / 4;
    Buffer<int64_t> starts(edge_count + 1);
    Buffer<int32_t> near(3 * face_count);
    check(mr_siblings(finer.data(), face_count, vertices, edge_count, starts.data(), near.data()));
    const size_t links = static_cast<size_t>(starts.data()[edge_count]);
    return nb::make_tuple(starts.one(edge_count + 1), near.one(links));
}

Out<double, 1> sibling_weights(In<int64_t, 1> starts, int weight) {
    expect(starts.shape(0) > 0 && starts.data()[0] == 0);
    const size_t count = starts.shape(0) - 1;
    for (size_t e = 0; e < count; ++e) expect(starts.data()[e] <= starts.data()[e + 1]);
    const size_t links = static_cast<size_t>(starts.data()[count]);
    Buffer<double> weights(links);
    mr_sibling_weights(starts.data(), count, weight, weights.data());
    return weights.one(links);
}

mr_level level_of(size_t frames, size_t vertices, const In<int32_t, 2>& faces, const In<int32_t, 2>& edges, int curvature) {
    expect(faces.shape(1) == 3 && edges.shape(1) == 2);
    return {frames, vertices, faces.data(), faces.shape(0), edges.data(), edges.shape(0), curvature};
}

nb::tuple edge_frames(In<double, 2> positions, In<int32_t, 2> faces, In<int32_t, 2> edges, int curvature) {
    expect(positions.shape(1) == 3);
    const mr_level level = level_of(1, positions.shape(0), faces, edges, curvature);
    Buffer<double> midpoints(3 * level.edge_count), directions(3 * level.edge_count);
    check(mr_edge_frames(&level, positions.data(), midpoints.data(), directions.data()));
    return nb::make_tuple(midpoints.two(level.edge_count, 3), directions.two(level.edge_count, 3));
}

using Place = std::optional<std::tuple<double, std::tuple<double, double, double>>>;  // scale and origin

mr_placement placement_of(const Place& place) {
    if (!place) return {};
    const auto& [scale, origin] = *place;
    return {scale, {std::get<0>(origin), std::get<1>(origin), std::get<2>(origin)}};
}

// The finer level's places of V x 3 x T rows and E x T scalars: T x (V + E) x 3, and whether all of them are finite.
nb::tuple refine(In<double, 3> rows, In<int32_t, 2> faces, In<int32_t, 2> edges, In<double, 2> scalars, int curvature) {
    const size_t vertices = rows.shape(0), frames = rows.shape(2), count = edges.shape(0);
    expect(rows.shape(1) == 3 && scalars.shape(0) == count && scalars.shape(1) == frames);
    const mr_level level = level_of(frames, vertices, faces, edges, curvature);
    Buffer<double> positions(3 * frames * (vertices + count));
    mr_frames out{positions.data(), nullptr, 0};
    check(mr_refine(&level, rows.data(), scalars.data(), &out));
    return nb::make_tuple(positions.three(frames, vertices + count, 3), out.finite != 0);
}

// V x 3 x T rows and a field of scalars -> rows of the finer level, and the last frame's scalars.
nb::tuple refine_field(In<double, 3> rows, In<int32_t, 2> faces, In<int32_t, 2> edges, nb::tuple field, int curvature) {
    const size_t vertices = rows.shape(0), frames = rows.shape(2), count = edges.shape(0);
    expect(rows.shape(1) == 3);
    const Field arrays(field);
    const mr_level level = level_of(frames, vertices, faces, edges, curvature);
    const mr_field scalars = arrays.view();
    Buffer<double> finer(3 * frames * (vertices + count)), last(count);
    std::copy(rows.data(), rows.data() + rows.size(), finer.data());
    check(mr_refine_field(&level, &scalars, finer.data(), last.data()));
    return nb::make_tuple(finer.three(vertices + count, 3, frames), last.one(count));
}

// The same of a last level, to T x (V + E) x 3 places. Whether all of them are finite, and the last frame's scalars.
nb::tuple refine_field_frames(In<double, 3> rows, In<int32_t, 2> faces, In<int32_t, 2> edges, nb::tuple field, int curvature,
                              Place place, InOut<double, 3> positions) {
    const size_t vertices = rows.shape(0), frames = rows.shape(2), count = edges.shape(0);
    expect(rows.shape(1) == 3);
    expect(positions.shape(0) == frames && positions.shape(1) == vertices + count && positions.shape(2) == 3);
    const Field arrays(field);
    const mr_level level = level_of(frames, vertices, faces, edges, curvature);
    const mr_field scalars = arrays.view();
    const mr_placement placement = placement_of(place);
    mr_frames out{positions.data(), place ? &placement : nullptr, 0};
    Buffer<double> last(count);
    check(mr_refine_field_frames(&level, &scalars, rows.data(), last.data(), &out));
    return nb::make_tuple(out.finite != 0, last.one(count));
}

// T x V x 3, and whether all of it is finite.
nb::tuple frames_of_rows(In<double, 3> rows, Place place) {
    const size_t vertices = rows.shape(0), frames = rows.shape(2);
    expect(rows.shape(1) == 3);
    const mr_placement placement = placement_of(place);
    Buffer<double> positions(3 * frames * vertices);
    mr_frames out{positions.data(), place ? &placement : nullptr, 0};
    check(mr_frames_of_rows(rows.data(), frames, vertices, &out));
    return nb::make_tuple(positions.three(frames, vertices, 3), out.finite != 0);
}

// Copies the faces of which `dropped` is 0 to the beginning of `room`; their number.
size_t keep_faces(In<int32_t, 2> faces, In<uint8_t, 1> dropped, InOut<int32_t, 2> room) {
    const size_t count = faces.shape(0);
    expect(faces.shape(1) == 3 && room.shape(1) == 3 && dropped.shape(0) == count && room.shape(0) >= count);
    return mr_keep_faces(faces.data(), dropped.data(), count, room.data());
}

meshreel_weights view(const InOut<int32_t, 2>& columns, const In<int64_t, 1>& starts, const In<int32_t, 1>& near) {
    expect(starts.shape(0) == columns.shape(1) + 1);
    return {columns.data(), columns.shape(1), columns.shape(0), starts.data(), near.data(), near.shape(0)};
}

void check_coded(int status) {
    if (status == MESHREEL_ENTROPY_NO_MEMORY) throw std::bad_alloc();
    if (status == MESHREEL_ENTROPY_BAD_INPUT) throw nb::value_error("the graph is not causal");
}

// The stream, and bytes of it that each column takes.
nb::tuple encode_field(InOut<int32_t, 2> columns, In<int64_t, 1> starts, In<int32_t, 1> near) {
    const meshreel_weights weights = view(columns, starts, near);
    std::vector<uint8_t> bytes(2 * columns.size() + 16);
    std::vector<size_t> ends(weights.columns);
    size_t size = 0;
    int status = meshreel_encode_field(&weights, bytes.data(), bytes.size(), &size, ends.data());
    if (status == MESHREEL_ENTROPY_OUT_TOO_SMALL) {
        bytes.resize(size);
        status = meshreel_encode_field(&weights, bytes.data(), bytes.size(), &size, ends.data());
    }
    check_coded(status);
    Buffer<int64_t> sizes(weights.columns);
    for (size_t c = 0; c < weights.columns; ++c) sizes.data()[c] = static_cast<int64_t>(ends[c] - (c > 0 ? ends[c - 1] : 0));
    return nb::make_tuple(nb::bytes(reinterpret_cast<const char*>(bytes.data()), size), sizes.one(weights.columns));
}

bool decode_field(const nb::bytes& data, InOut<int32_t, 2> columns, In<int64_t, 1> starts, In<int32_t, 1> near) {
    const meshreel_weights weights = view(columns, starts, near);
    const int status = meshreel_decode_field(&weights, reinterpret_cast<const uint8_t*>(data.c_str()), data.size());
    check_coded(status);
    return status == MESHREEL_ENTROPY_OK;
}

}  // namespace

// What is written to is never converted: a copy would be, and the array given would stay as it was.
void bind_layers(nb::module_& m) {
    m.def("hierarchy", &hierarchy);
    m.def("predict_forward", &predict_forward);
    m.def("predict_surface", &predict_surface);
    m.def("field_inverse", &field_inverse);
    m.def("orthonormal_inverse", &orthonormal_inverse);
    m.def("subdivide", &subdivide);
    m.def("siblings", &siblings);
    m.def("place_rows", &place_rows);
    m.def("sibling_weights", &sibling_weights);
    m.def("edge_frames", &edge_frames);
    m.def("refine", &refine);
    m.def("refine_field", &refine_field);
    m.def("refine_field_frames", &refine_field_frames, "rows"_a, "faces"_a, "edges"_a, "field"_a, "curvature"_a, "place"_a.none(),
          "positions"_a.noconvert());
    m.def("frames_of_rows", &frames_of_rows, "rows"_a, "place"_a.none());
    m.def("keep_faces", &keep_faces, "faces"_a, "dropped"_a, "room"_a.noconvert());
    m.def("encode_field", &encode_field);
    m.def("decode_field", &decode_field, "data"_a, "columns"_a.noconvert(), "starts"_a, "near"_a);
}
