// The Python face of core/: one bind_* function for each part, each in its own file.
#include <nanobind/nanobind.h>

namespace meshreel {

void bind_decoder(nanobind::module_&);
void bind_draco(nanobind::module_&);
void bind_deform(nanobind::module_&);
void bind_dense(nanobind::module_&);
void bind_entropy(nanobind::module_&);
void bind_laplacian(nanobind::module_&);
void bind_layers(nanobind::module_&);
void bind_fit(nanobind::module_&);
void bind_raster(nanobind::module_&);
void bind_reading(nanobind::module_&);
void bind_topology(nanobind::module_&);
void bind_tracking(nanobind::module_&);
void bind_voxels(nanobind::module_&);

}  // namespace meshreel

NB_MODULE(_core, m) {
    m.doc() = "The arithmetic that must be fast, and equal to the bit in every build.";
    meshreel::bind_decoder(m);
    meshreel::bind_draco(m);
    meshreel::bind_deform(m);
    meshreel::bind_dense(m);
    meshreel::bind_entropy(m);
    meshreel::bind_laplacian(m);
    meshreel::bind_layers(m);
    meshreel::bind_fit(m);
    meshreel::bind_raster(m);
    meshreel::bind_reading(m);
    meshreel::bind_topology(m);
    meshreel::bind_tracking(m);
    meshreel::bind_voxels(m);
}
