#include "meshreel/entropy.h"

#include <cstdint>
#include <vector>

#include "arrays.h"

namespace meshreel {
namespace {

using Columns = InOut<int32_t, 2>;
using Starts = In<int64_t, 1>;
using Indices = In<int32_t, 1>;

mr_weights view(const Columns& columns, const Starts& starts, const Indices& indices) {
    if (starts.shape(0) != columns.shape(1) + 1) throw nb::value_error("starts must have one entry more than vertices");
    return {columns.data(), columns.shape(1), columns.shape(0), starts.data(), indices.data(), indices.shape(0)};
}

nb::list encode_weights(const Columns& columns, const Starts& starts, const Indices& indices) {
    const mr_weights weights = view(columns, starts, indices);
    std::vector<size_t> sizes(weights.columns);
    std::vector<uint8_t> bytes(2 * weights.columns * (weights.count + 8));
    int status = mr_encode_weights(&weights, bytes.data(), bytes.size(), sizes.data());
    if (status == MR_OUT_TOO_SMALL) {
        size_t total = 0;
        for (size_t size : sizes) total += size;
        bytes.resize(total);
        status = mr_encode_weights(&weights, bytes.data(), bytes.size(), sizes.data());
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
int64_t decode_weights(const nb::bytes& data, const Starts& sizes, const Columns& columns, const Starts& starts,
                       const Indices& indices) {
    const mr_weights weights = view(columns, starts, indices);
    if (sizes.shape(0) != weights.columns) throw nb::value_error("one size for each column");
    std::vector<size_t> lengths(weights.columns);
    size_t left = data.size();
    for (size_t c = 0; c < weights.columns; ++c) {
        if (sizes.data()[c] < 0 || static_cast<uint64_t>(sizes.data()[c]) > left)
            throw nb::value_error("sizes exceed the data");
        left -= lengths[c] = static_cast<size_t>(sizes.data()[c]);
    }
    size_t column = 0;
    const int status =
        mr_decode_weights(&weights, reinterpret_cast<const uint8_t*>(data.c_str()), lengths.data(), &column);
    if (status != MR_BAD_STREAM) check(status);
    return status == MR_OK ? -1 : static_cast<int64_t>(column);
}

void weight_contexts(const Columns& columns, const Starts& starts, const Indices& indices,
                     const InOut<uint8_t, 2>& classes, const InOut<uint8_t, 2>& signs) {
    const mr_weights weights = view(columns, starts, indices);
    if (classes.size() != columns.size() || signs.size() != columns.size())
        throw nb::value_error("one context a symbol");
    check(without_gil([&] { return mr_weight_contexts(&weights, classes.data(), signs.data()); }));
}

nb::bytes encode_integers(const Indices& values) {
    std::vector<uint8_t> bytes(4 * values.shape(0) + 16);
    size_t size = 0;
    int status = mr_encode_integers(values.data(), values.shape(0), bytes.data(), bytes.size(), &size);
    if (status == MR_OUT_TOO_SMALL) {
        bytes.resize(size);
        status = mr_encode_integers(values.data(), values.shape(0), bytes.data(), bytes.size(), &size);
    }
    check(status);
    return nb::bytes(bytes.data(), size);
}

bool decode_integers(const nb::bytes& data, const InOut<int32_t, 1>& values) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(data.c_str());
    return mr_decode_integers(bytes, data.size(), values.shape(0), values.data()) == MR_OK;
}

}  // namespace

// Arrays that are written to are bound with .noconvert(): a converted copy would leave the caller's array as it was.
void bind_entropy(nb::module_& m) {
    m.def("encode_weights", &encode_weights);
    m.def("decode_weights", &decode_weights, nb::arg("data"), nb::arg("sizes"), nb::arg("columns").noconvert(),
          nb::arg("starts"), nb::arg("indices"));
    m.def("weight_contexts", &weight_contexts, nb::arg("columns"), nb::arg("starts"), nb::arg("indices"),
          nb::arg("classes").noconvert(), nb::arg("signs").noconvert());
    m.def("encode_integers", &encode_integers);
    m.def("decode_integers", &decode_integers, nb::arg("data"), nb::arg("values").noconvert());
}

}  // namespace meshreel
