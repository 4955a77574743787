// The Python face of core/: one bind_* function for each part, each in its own file.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_entropy(nb::module_&);
void bind_laplacian(nb::module_&);
void bind_layers(nb::module_&);
void bind_tracking(nb::module_&);

NB_MODULE(_core, m) {
    m.doc() = "The arithmetic that must be fast, and bit-equal in every build.";
    bind_entropy(m);
    bind_laplacian(m);
    bind_layers(m);
    bind_tracking(m);
}
