#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <memory>
#include <stdexcept>

#include "meshreel/laplacian.h"

namespace nb = nanobind;

namespace {

template <class Scalar>
using In2 = nb::ndarray<const Scalar, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class Scalar>
using In1 = nb::ndarray<const Scalar, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class Scalar>
using Out1 = nb::ndarray<nb::numpy, Scalar, nb::ndim<1>>;
template <class Scalar>
using Out2 = nb::ndarray<nb::numpy, Scalar, nb::ndim<2>>;

template <class Scalar>
struct Buffer {
    explicit Buffer(size_t count) : owned(new Scalar[count]) {}
    Scalar* data() { return owned.get(); }
    nb::capsule release() {
        return nb::capsule(owned.release(), [](void* p) noexcept { delete[] static_cast<Scalar*>(p); });
    }
    Out1<Scalar> one(size_t n) {
        Scalar* p = data();
        return Out1<Scalar>(p, {n}, release());
    }
    Out2<Scalar> two(size_t n, size_t m) {
        Scalar* p = data();
        return Out2<Scalar>(p, {n, m}, release());
    }
    std::unique_ptr<Scalar[]> owned;
};

void check(int status) {
    if (status == MR_LAPLACIAN_OK) return;
    if (status == MR_LAPLACIAN_NO_MEMORY) throw std::bad_alloc();
    throw nb::value_error(status == MR_LAPLACIAN_SINGULAR
                              ? "a connected component has no anchor"
                              : "an index is out of range, anchors do not ascend, or a coordinate is not finite");
}

void expect(bool fits) {
    if (!fits) throw nb::value_error("array sizes do not fit");
}

class Laplacian {
  public:
    Laplacian(In2<double> vertices, In2<int32_t> faces, In1<int32_t> anchors, double anchor_weight)
        : vertices_(vertices.shape(0)), rows_(vertices.shape(0) + anchors.shape(0)) {
        expect(vertices.shape(1) == 3 && faces.shape(1) == 3);
        check(mr_laplacian_create(vertices.data(), vertices.shape(0), faces.data(), faces.shape(0), anchors.data(),
                                  anchors.shape(0), anchor_weight, &system_));
    }
    Laplacian(const Laplacian&) = delete;
    ~Laplacian() { mr_laplacian_destroy(system_); }

    nb::tuple weights() const {
        const size_t count = mr_laplacian_weights(system_, nullptr, nullptr, nullptr);
        Buffer<int32_t> rows(count), columns(count);
        Buffer<double> values(count);
        mr_laplacian_weights(system_, rows.data(), columns.data(), values.data());
        return nb::make_tuple(rows.one(count), columns.one(count), values.one(count));
    }

    Out2<double> forward(In2<double> weights) const {
        expect(weights.shape(0) == vertices_);
        const size_t columns = weights.shape(1);
        Buffer<double> deltas(rows_ * columns);
        check(mr_laplacian_forward(system_, weights.data(), columns, deltas.data()));
        return deltas.two(rows_, columns);
    }

    Out2<double> inverse(In2<double> deltas) {
        expect(deltas.shape(0) == rows_);
        const size_t columns = deltas.shape(1);
        Buffer<double> weights(vertices_ * columns);
        check(mr_laplacian_inverse(system_, deltas.data(), columns, weights.data()));
        return weights.two(vertices_, columns);
    }

    Out2<int32_t> quantize(In2<double> deltas, In1<double> steps, In1<double> prices) {
        const size_t columns = deltas.shape(1);
        expect(deltas.shape(0) == rows_ && steps.shape(0) == columns && prices.shape(0) == columns);
        Buffer<int32_t> symbols(rows_ * columns);
        check(mr_laplacian_quantize(system_, deltas.data(), columns, steps.data(), prices.data(), symbols.data()));
        return symbols.two(rows_, columns);
    }

  private:
    size_t vertices_, rows_;
    mr_laplacian* system_ = nullptr;
};

Out1<int32_t> farthest_anchors(In2<int32_t> faces, int64_t vertices, int64_t count) {
    expect(faces.shape(1) == 3 && vertices >= 0);
    Buffer<int32_t> anchors(static_cast<size_t>(vertices));
    const int64_t found = mr_farthest_anchors(faces.data(), faces.shape(0), vertices, count, anchors.data());
    check(found < 0 ? MR_LAPLACIAN_BAD_INPUT : MR_LAPLACIAN_OK);
    return anchors.one(static_cast<size_t>(found));
}

Out2<double> klt_inverse(In2<double> weights, In2<double> vectors, In1<double> mean) {
    expect(weights.shape(1) == vectors.shape(0) && vectors.shape(1) == mean.shape(0));
    const size_t rows = weights.shape(0), width = mean.shape(0);
    Buffer<double> field(rows * width);
    mr_klt_inverse(weights.data(), rows, weights.shape(1), vectors.data(), mean.data(), width, field.data());
    return field.two(rows, width);
}

}  // namespace

void bind_laplacian(nb::module_& m) {
    nb::class_<Laplacian>(m, "Laplacian")
        .def(nb::init<In2<double>, In2<int32_t>, In1<int32_t>, double>(), nb::arg("vertices"), nb::arg("faces"), nb::arg("anchors"),
             nb::arg("anchor_weight"))
        .def("weights", &Laplacian::weights)
        .def("forward", &Laplacian::forward, nb::arg("weights"))
        .def("inverse", &Laplacian::inverse, nb::arg("deltas"))
        .def("quantize", &Laplacian::quantize, nb::arg("deltas"), nb::arg("steps"), nb::arg("prices"));
    m.def("farthest_anchors", &farthest_anchors, nb::arg("faces"), nb::arg("vertices"), nb::arg("count"));
    m.def("klt_inverse", &klt_inverse, nb::arg("weights"), nb::arg("vectors"), nb::arg("mean"));
}
