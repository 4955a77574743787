#include <vector>

#include "arrays.h"
#include "meshreel/draco.h"

namespace meshreel {
namespace {

void check_draco(const nb::list& meshes) {
    std::vector<mr_bytes> bytes;
    for (const nb::handle mesh : meshes) bytes.push_back(bytes_of(nb::cast<nb::bytes>(mesh)));
    check_decoded(mr_check_draco(bytes.data(), bytes.size()));
}

}  // namespace

void bind_draco(nb::module_& m) { m.def("check_draco", &check_draco); }

}  // namespace meshreel
