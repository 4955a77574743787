#include "meshreel/reading.h"

#include "arrays.h"

namespace meshreel {
namespace {

double nearest(const char* word) { return PyOS_string_to_double(word, nullptr, nullptr); }

nb::tuple split_lines(In<uint8_t, 1> text, char comment) {
    const size_t size = text.shape(0);
    const uint8_t* data = text.data();
    size_t room = 1;
    for (size_t k = 0; k < size; ++k) room += data[k] == '\n' || data[k] == '\r';
    Buffer<int64_t> starts(room), ends(room);
    const size_t count = mr_split_lines(reinterpret_cast<const char*>(data), size, comment, starts.data(), ends.data());
    return nb::make_tuple(starts.shaped(count), ends.shaped(count));
}

// Numbers, their count in each line, and where the first word is that is none: -1 for no such word.
nb::tuple read_numbers(In<uint8_t, 1> text, In<int64_t, 1> starts, In<int64_t, 1> ends, char stop, size_t field) {
    const size_t count = starts.shape(0);
    expect(ends.shape(0) == count);
    size_t room = 0;
    for (size_t k = 0; k < count; ++k) {
        const int64_t start = starts.data()[k], end = ends.data()[k];
        expect(start >= 0 && start <= end && static_cast<size_t>(end) <= text.shape(0) && end - start <= INT32_MAX);
        room += static_cast<size_t>(end - start) / 2 + 1;
    }
    Buffer<double> values(room);
    Buffer<int32_t> counts(count);
    int64_t bad = -1, found = 0;
    const mr_lines lines{reinterpret_cast<const char*>(text.data()), starts.data(), ends.data(), count, stop, field};
    const int status = mr_read_numbers(&lines, nearest, values.data(), counts.data(), &bad);
    if (PyErr_Occurred()) throw nb::python_error();
    if (bad < 0) check(status);
    for (size_t k = 0; bad < 0 && k < count; ++k) found += counts.data()[k];
    Buffer<double> exact(values.data(), static_cast<size_t>(found));
    return nb::make_tuple(exact.shaped(found), counts.shaped(count), bad);
}

// The items of the field `wanted` of all rows, as bytes, their number in each row, the bytes of all rows, and the first
// row that the data ends in: -1 for no such row.
nb::tuple read_lists(In<uint8_t, 1> data, In<int64_t, 2> fields, size_t count, size_t wanted, bool big_endian) {
    expect(fields.shape(1) == 2 && fields.shape(0) > wanted && count <= data.shape(0));
    for (size_t f = 0; f < fields.shape(0); ++f) {
        const int64_t digits = fields.data()[2 * f], width = fields.data()[2 * f + 1];
        expect(digits >= 0 && digits <= 8 && width > 0);
    }
    Buffer<uint8_t> items(data.shape(0));
    Buffer<int64_t> lengths(count);
    const mr_rows rows{data.data(), data.shape(0), count, fields.data(), fields.shape(0), big_endian};
    size_t size = 0, bad = 0;
    if (mr_read_lists(&rows, wanted, items.data(), lengths.data(), &size, &bad) != MR_OK)
        return nb::make_tuple(Buffer<uint8_t>(0).shaped(0), Buffer<int64_t>(0).shaped(0), size, bad);
    size_t bytes = 0;
    for (size_t row = 0; row < count; ++row)
        bytes += static_cast<size_t>(lengths.data()[row] * fields.data()[2 * wanted + 1]);
    Buffer<uint8_t> exact(items.data(), bytes);
    return nb::make_tuple(exact.shaped(bytes), lengths.shaped(count), size, -1);
}

}  // namespace

void bind_reading(nb::module_& m) {
    m.def("split_lines", &split_lines);
    m.def("read_numbers", &read_numbers);
    m.def("read_lists", &read_lists);
}

}  // namespace meshreel
