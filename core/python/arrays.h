// NumPy arrays in and out of the core, and its statuses as Python's exceptions.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstring>
#include <new>

#include "../src/scratch.h"
#include "meshreel/status.h"

namespace meshreel {

namespace nb = nanobind;

template <class T, int N>
using In = nb::ndarray<const T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;
template <class T, int N>
using InOut = nb::ndarray<T, nb::ndim<N>, nb::c_contig, nb::device::cpu>;  // bind it with .noconvert()
template <class T, int N>
using Out = nb::ndarray<nb::numpy, T, nb::ndim<N>>;

// Memory of an array that Python will own.
template <class T>
class Buffer {
public:
    explicit Buffer(size_t count) : owned_(scratch<T>(count)) {}
    Buffer(const T* from, size_t count) : Buffer(count) {
        if (count > 0) std::memcpy(data(), from, count * sizeof(T));
    }
    T* data() { return owned_.get(); }

    template <class... Sizes>
    Out<T, sizeof...(Sizes)> shaped(Sizes... sizes) {
        T* p = data();
        nb::capsule owner(owned_.release(), [](void* memory) noexcept { give_block(memory); });
        return Out<T, sizeof...(Sizes)>(p, {static_cast<size_t>(sizes)...}, owner);
    }

private:
    Scratch<T> owned_;
};

// Raises ValueError for arguments that the core refuses.
inline void check(int status) {
    if (status == MR_NO_MEMORY) throw std::bad_alloc();
    if (status != MR_OK) throw nb::value_error(mr_message(status));
}

// Raises FormatError instead, for what was decoded from a file.
inline void check_decoded(int status) {
    if (status == MR_NO_MEMORY) throw std::bad_alloc();
    if (status == MR_OK) return;
    const nb::object error = nb::module_::import_("meshreel.errors").attr("FormatError");
    PyErr_SetString(error.ptr(), mr_message(status));
    throw nb::python_error();
}

// Result of a call of the core, during which other threads may run Python.
template <class Call>
int without_gil(Call call) {
    const nb::gil_scoped_release released;
    return call();
}

inline void expect(bool fits) {
    if (!fits) throw nb::value_error("array sizes do not fit");
}

inline mr_bytes bytes_of(const nb::bytes& bytes) {
    return {reinterpret_cast<const uint8_t*>(bytes.c_str()), bytes.size()};
}

inline mr_mesh mesh_of(const In<double, 2>& positions, const In<int32_t, 2>& faces) {
    expect(positions.shape(1) == 3 && faces.shape(1) == 3);
    return {positions.data(), positions.shape(0), faces.data(), faces.shape(0)};
}

}  // namespace meshreel
