#include "meshreel/dense.h"

#include "arrays.h"

namespace meshreel {
namespace {

using namespace nb::literals;

Out<double, 3> products(In<double, 3> a, In<double, 3> b) {
    expect(a.shape(0) == b.shape(0) && a.shape(2) == b.shape(1));
    Buffer<double> out(a.shape(0) * a.shape(1) * b.shape(2));
    mr_products(a.data(), b.data(), a.shape(0), a.shape(1), a.shape(2), b.shape(2), out.data());
    return out.shaped(a.shape(0), a.shape(1), b.shape(2));
}

Out<double, 3> inverses(In<double, 3> matrices) {
    expect(matrices.shape(1) == matrices.shape(2));
    Buffer<double> out(matrices.size());
    check(without_gil([&] { return mr_inverses(matrices.data(), matrices.shape(0), matrices.shape(1), out.data()); }));
    return out.shaped(matrices.shape(0), matrices.shape(1), matrices.shape(2));
}

nb::tuple eigen(In<double, 3> matrices) {
    expect(matrices.shape(1) == matrices.shape(2));
    const size_t count = matrices.shape(0), size = matrices.shape(1);
    Buffer<double> values(count * size), vectors(count * size * size);
    check(without_gil([&] { return mr_eigen(matrices.data(), count, size, values.data(), vectors.data()); }));
    return nb::make_tuple(values.shaped(count, size), vectors.shaped(count, size, size));
}

template <void (*function)(const double*, size_t, double*)>
Out<double, 1> each(In<double, 1> x) {
    Buffer<double> out(x.shape(0));
    function(x.data(), x.shape(0), out.data());
    return out.shaped(x.shape(0));
}

Out<double, 1> angle(In<double, 1> y, In<double, 1> x) {
    expect(y.shape(0) == x.shape(0));
    Buffer<double> out(x.shape(0));
    mr_angle(y.data(), x.data(), x.shape(0), out.data());
    return out.shaped(x.shape(0));
}

}  // namespace

void bind_dense(nb::module_& m) {
    m.def("products", &products, "a"_a, "b"_a);
    m.def("inverses", &inverses, "matrices"_a);
    m.def("eigen", &eigen, "matrices"_a);
    m.def("exp", &each<mr_exp>, "x"_a);
    m.def("log2", &each<mr_log2>, "x"_a);
    m.def("angle", &angle, "y"_a, "x"_a);
}

}  // namespace meshreel
