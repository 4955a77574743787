#include <algorithm>
#include <optional>

#include "meshreel/raster.h"
#include "trees.h"

namespace meshreel {
namespace {

using namespace nb::literals;

nb::tuple draw(In<double, 2> positions, In<int32_t, 2> faces, In<double, 2> turn, In<double, 1> shift,
               In<double, 1> lens, bool parallel, In<int32_t, 1> crop, bool weighted) {
    expect(are_vectors(turn, 3) && shift.shape(0) == 3 && lens.shape(0) == 4 && crop.shape(0) == 4);
    const mr_mesh mesh = mesh_of(positions, faces);
    mr_viewer viewer{};
    std::copy(turn.data(), turn.data() + 9, viewer.turn);
    std::copy(shift.data(), shift.data() + 3, viewer.shift);
    std::copy(lens.data(), lens.data() + 2, viewer.focal);
    std::copy(lens.data() + 2, lens.data() + 4, viewer.center);
    viewer.parallel = parallel;
    const mr_crop part{crop.data()[0], crop.data()[1], crop.data()[2], crop.data()[3]};
    if (part.width < 0 || part.height < 0) throw nb::value_error(mr_message(MR_BAD_INPUT));
    const size_t wide = static_cast<size_t>(part.width), high = static_cast<size_t>(part.height);
    Buffer<int32_t> seen(wide * high);
    Buffer<double> depths(wide * high);
    std::optional<Buffer<double>> weights;
    size_t covered = 0;
    check(without_gil([&] {
        const int status = mr_draw(&mesh, &viewer, &part, seen.data(), depths.data());
        if (status != MR_OK || !weighted) return status;
        covered = wide * high - static_cast<size_t>(std::count(seen.data(), seen.data() + wide * high, -1));
        return mr_draw_weights(&mesh, &viewer, &part, seen.data(), weights.emplace(3 * covered).data());
    }));
    nb::object places = nb::none();
    if (weights) places = nb::cast(weights->shaped(covered, 3));
    return nb::make_tuple(seen.shaped(high, wide), depths.shaped(high, wide), places);
}

}  // namespace

void bind_raster(nb::module_& m) {
    m.def("draw", &draw, "positions"_a, "faces"_a, "turn"_a, "shift"_a, "lens"_a, "parallel"_a, "crop"_a, "weighted"_a,
          "The face that each pixel of a crop sees, its depth, and the weights of its corners where a face is seen, or "
          "None.");
}

}  // namespace meshreel
