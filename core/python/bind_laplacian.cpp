#include "meshreel/laplacian.h"

#include "arrays.h"

namespace meshreel {
namespace {

class Laplacian {
public:
    Laplacian(In<double, 2> vertices, In<int32_t, 2> faces, In<int32_t, 1> anchors, double anchor_weight)
        : vertices_(vertices.shape(0)), rows_(vertices.shape(0) + anchors.shape(0)) {
        const mr_mesh mesh = mesh_of(vertices, faces);
        check(without_gil(
            [&] { return mr_laplacian_create(&mesh, anchors.data(), anchors.shape(0), anchor_weight, &system_); }));
    }
    Laplacian(const Laplacian&) = delete;
    ~Laplacian() { mr_laplacian_destroy(system_); }

    nb::tuple weights() const {
        const size_t count = mr_laplacian_weights(system_, nullptr, nullptr, nullptr);
        Buffer<int32_t> rows(count), columns(count);
        Buffer<double> values(count);
        mr_laplacian_weights(system_, rows.data(), columns.data(), values.data());
        return nb::make_tuple(rows.shaped(count), columns.shaped(count), values.shaped(count));
    }

    Out<double, 2> forward(In<double, 2> weights) const {
        expect(weights.shape(0) == vertices_);
        const size_t columns = weights.shape(1);
        Buffer<double> deltas(rows_ * columns);
        check(without_gil([&] { return mr_laplacian_forward(system_, weights.data(), columns, deltas.data()); }));
        return deltas.shaped(rows_, columns);
    }

    Out<double, 2> inverse(In<double, 2> deltas) {
        expect(deltas.shape(0) == rows_);
        const size_t columns = deltas.shape(1);
        Buffer<double> weights(vertices_ * columns);
        check(without_gil([&] { return mr_laplacian_inverse(system_, deltas.data(), columns, weights.data()); }));
        return weights.shaped(vertices_, columns);
    }

    Out<int32_t, 2> quantize(In<double, 2> deltas, In<double, 1> steps, In<double, 1> prices) {
        const size_t columns = deltas.shape(1);
        expect(deltas.shape(0) == rows_ && steps.shape(0) == columns && prices.shape(0) == columns);
        Buffer<int32_t> symbols(rows_ * columns);
        check(without_gil([&] {
            return mr_laplacian_quantize(system_, deltas.data(), columns, steps.data(), prices.data(), symbols.data());
        }));
        return symbols.shaped(rows_, columns);
    }

private:
    size_t vertices_, rows_;
    mr_laplacian* system_ = nullptr;
};

Out<int32_t, 1> farthest_anchors(In<int32_t, 2> faces, int64_t vertices, int64_t count) {
    expect(faces.shape(1) == 3 && vertices >= 0);
    Buffer<int32_t> anchors(static_cast<size_t>(vertices));
    const int64_t found = mr_farthest_anchors(faces.data(), faces.shape(0), vertices, count, anchors.data());
    check(found < 0 ? MR_BAD_INPUT : MR_OK);
    return anchors.shaped(static_cast<size_t>(found));
}

Out<double, 2> klt_inverse(In<double, 2> weights, In<double, 2> vectors, In<double, 1> mean) {
    expect(weights.shape(1) == vectors.shape(0) && vectors.shape(1) == mean.shape(0));
    const size_t rows = weights.shape(0), width = mean.shape(0);
    Buffer<double> field(rows * width);
    mr_klt_inverse(weights.data(), rows, weights.shape(1), vectors.data(), mean.data(), width, field.data());
    return field.shaped(rows, width);
}

}  // namespace

void bind_laplacian(nb::module_& m) {
    nb::class_<Laplacian>(m, "Laplacian")
        .def(nb::init<In<double, 2>, In<int32_t, 2>, In<int32_t, 1>, double>(), nb::arg("vertices"), nb::arg("faces"),
             nb::arg("anchors"), nb::arg("anchor_weight"))
        .def("weights", &Laplacian::weights)
        .def("forward", &Laplacian::forward, nb::arg("weights"))
        .def("inverse", &Laplacian::inverse, nb::arg("deltas"))
        .def("quantize", &Laplacian::quantize, nb::arg("deltas"), nb::arg("steps"), nb::arg("prices"));
    m.def("farthest_anchors", &farthest_anchors, nb::arg("faces"), nb::arg("vertices"), nb::arg("count"));
    m.def("klt_inverse", &klt_inverse, nb::arg("weights"), nb::arg("vectors"), nb::arg("mean"));
}

}  // namespace meshreel
