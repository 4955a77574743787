#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_entropy(nb::module_&) {}
