#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_laplacian(nb::module_&) {}
