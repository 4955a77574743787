#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_tracking(nb::module_&) {}
