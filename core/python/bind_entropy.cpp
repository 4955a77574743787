#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <new>
#include <stdexcept>
#include <vector>

#include "meshreel/entropy.h"

namespace nb = nanobind;

namespace {

template <class T, int N>
using Array = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
using Columns = Array<int32_t, 2>;
using Starts = Array<const int64_t, 1>;
using Indices = Array<const int32_t, 1>;

meshreel_weights view(const Columns& columns, const Starts& starts, const Indices& indices) {
    if (starts.shape(0) != columns.shape(1) + 1) throw std::invalid_argument("starts must have one entry more than vertices");
    return {columns.data(), columns.shape(1), columns.shape(0), starts.data(), indices.data(), indices.shape(0)};
}

void check(int status) {
    if (status == MESHREEL_ENTROPY_NO_MEMORY) throw std::bad_alloc();
    if (status == MESHREEL_ENTROPY_BAD_INPUT) throw std::invalid_argument("neighbours must be smaller indices in order");
}

nb::list encode_weights(const Columns& columns, const Starts& starts, const Indices& indices) {
    const meshreel_weights weights = view(columns, starts, indices);
    std::vector<size_t> sizes(weights.columns);
    std::vector<uint8_t> bytes(2 * weights.columns * (weights.count + 8));
    int status = meshreel_encode_weights(&weights, bytes.data(), bytes.size(), sizes.data());
    if (status == MESHREEL_ENTROPY_OUT_TOO_SMALL) {
        size_t total = 0;
        for (size_t size : sizes) total += size;
        bytes.resize(total);
        status = meshreel_encode_weights(&weights, bytes.data(), bytes.size(), sizes.data());
    }
    check(status);
    nb::list streams;
    size_t begin = 0;
    for (size_t size : sizes) {
        streams.append(nb::bytes(bytes.data() + begin, size));
        begin += size;
    }
    return streams;
}

// The column that failed, or -1.
int64_t decode_weights(const nb::bytes& data, const Array<const int64_t, 1>& sizes, const Columns& columns, const Starts& starts,
                       const Indices& indices) {
    const meshreel_weights weights = view(columns, starts, indices);
    if (sizes.shape(0) != weights.columns) throw std::invalid_argument("one size for each column");
    std::vector<size_t> lengths(weights.columns);
    size_t left = data.size();
    for (size_t c = 0; c < weights.columns; ++c) {
        if (sizes.data()[c] < 0 || static_cast<uint64_t>(sizes.data()[c]) > left) throw std::invalid_argument("sizes exceed the data");
        left -= lengths[c] = static_cast<size_t>(sizes.data()[c]);
    }
    size_t column = 0;
    const int status = meshreel_decode_weights(&weights, reinterpret_cast<const uint8_t*>(data.c_str()), lengths.data(), &column);
    check(status);
    return status == MESHREEL_ENTROPY_OK ? -1 : static_cast<int64_t>(column);
}

void weight_contexts(const Columns& columns, const Starts& starts, const Indices& indices, const Array<uint8_t, 2>& classes,
                     const Array<uint8_t, 2>& signs) {
    const meshreel_weights weights = view(columns, starts, indices);
    if (classes.size() != columns.size() || signs.size() != columns.size()) throw std::invalid_argument("one context a symbol");
    check(meshreel_weight_contexts(&weights, classes.data(), signs.data()));
}

nb::bytes encode_integers(const Indices& values) {
    std::vector<uint8_t> bytes(4 * values.shape(0) + 16);
    size_t size = 0;
    int status = meshreel_encode_integers(values.data(), values.shape(0), bytes.data(), bytes.size(), &size);
    if (status == MESHREEL_ENTROPY_OUT_TOO_SMALL) {
        bytes.resize(size);
        status = meshreel_encode_integers(values.data(), values.shape(0), bytes.data(), bytes.size(), &size);
    }
    check(status);
    return nb::bytes(bytes.data(), size);
}

bool decode_integers(const nb::bytes& data, const Array<int32_t, 1>& values) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(data.c_str());
    return meshreel_decode_integers(bytes, data.size(), values.shape(0), values.data()) == MESHREEL_ENTROPY_OK;
}

}  // namespace

// What is written to is never converted: a copy would be, and the array given would stay as it was.
void bind_entropy(nb::module_& m) {
    m.def("encode_weights", &encode_weights);
    m.def("decode_weights", &decode_weights, nb::arg("data"), nb::arg("sizes"), nb::arg("columns").noconvert(), nb::arg("starts"), nb::arg("indices"));
    m.def("weight_contexts", &weight_contexts, nb::arg("columns"), nb::arg("starts"), nb::arg("indices"), nb::arg("classes").noconvert(),
          nb::arg("signs").noconvert());
    m.def("encode_integers", &encode_integers);
    m.def("decode_integers", &decode_integers, nb::arg("data"), nb::arg("values").noconvert());
}
