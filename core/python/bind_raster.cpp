#include <nanobind/stl/optional.h>

#include <algorithm>
#include <optional>

#include "meshreel/raster.h"
#include "meshreel/views.h"
#include "trees.h"

namespace meshreel {
namespace {

using namespace nb::literals;

mr_viewer viewer_of(const In<double, 2>& turn, const In<double, 1>& shift, const In<double, 1>& lens, bool parallel) {
    expect(are_vectors(turn, 3) && shift.shape(0) == 3 && lens.shape(0) == 4);
    mr_viewer viewer{};
    std::copy(turn.data(), turn.data() + 9, viewer.turn);
    std::copy(shift.data(), shift.data() + 3, viewer.shift);
    std::copy(lens.data(), lens.data() + 2, viewer.focal);
    std::copy(lens.data() + 2, lens.data() + 4, viewer.center);
    viewer.parallel = parallel;
    return viewer;
}

nb::tuple draw(In<double, 2> positions, In<int32_t, 2> faces, In<double, 2> turn, In<double, 1> shift,
               In<double, 1> lens, bool parallel, In<int32_t, 1> crop, bool weighted) {
    expect(crop.shape(0) == 4);
    const mr_mesh mesh = mesh_of(positions, faces);
    const mr_viewer viewer = viewer_of(turn, shift, lens, parallel);
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

void add_view(In<double, 2> turn, In<double, 1> shift, In<double, 1> eye, In<double, 1> lens, In<double, 1> bend,
              In<int32_t, 1> size, In<float, 2> depth, In<uint8_t, 2> from_step, In<double, 1> limits,
              std::optional<In<uint8_t, 3>> pixels, In<double, 1> gains, In<double, 2> points, In<double, 2> normals,
              InOut<double, 2> sums, InOut<double, 1> weights) {
    const size_t count = points.shape(0);
    expect(eye.shape(0) == 3 && bend.shape(0) <= 8 && size.shape(0) == 3 && limits.shape(0) == 4 &&
           gains.shape(0) == 3 && depth.shape(0) == from_step.shape(0) && depth.shape(1) == from_step.shape(1) &&
           are_vectors(points, count) && are_vectors(normals, count) && weights.shape(0) == count &&
           (!pixels || pixels->shape(2) == 3) && (!pixels || (sums.shape(0) == count && sums.shape(1) == 3)));
    mr_view view{};
    view.viewer = viewer_of(turn, shift, lens, false);
    std::copy(eye.data(), eye.data() + 3, view.eye);
    std::copy(bend.data(), bend.data() + bend.shape(0), view.bend);
    view.bends = std::any_of(view.bend, view.bend + 8, [](double number) { return number != 0; });
    view.width = size.data()[0], view.height = size.data()[1], view.shrink = size.data()[2];
    view.depth = depth.data(), view.from_step = from_step.data();
    view.rows = static_cast<int32_t>(depth.shape(0)), view.columns = static_cast<int32_t>(depth.shape(1));
    view.margin = limits.data()[0], view.share = limits.data()[1];
    view.least = limits.data()[2], view.at_step = limits.data()[3];
    if (pixels) {
        view.pixels = pixels->data();
        view.picture_rows = static_cast<int32_t>(pixels->shape(0));
        view.picture_columns = static_cast<int32_t>(pixels->shape(1));
        std::copy(gains.data(), gains.data() + 3, view.gains);
    }
    check(without_gil(
        [&] { return mr_add_view(&view, points.data(), normals.data(), count, sums.data(), weights.data()); }));
}

}  // namespace

void bind_raster(nb::module_& m) {
    m.def("draw", &draw, "positions"_a, "faces"_a, "turn"_a, "shift"_a, "lens"_a, "parallel"_a, "crop"_a, "weighted"_a,
          "The face that each pixel of a crop sees, its depth, and the weights of its corners where a face is seen, or "
          "None.");
    m.def("add_view", &add_view, "turn"_a, "shift"_a, "eye"_a, "lens"_a, "bend"_a, "size"_a, "depth"_a, "from_step"_a,
          "limits"_a, "pixels"_a.none(), "gains"_a, "points"_a, "normals"_a, "sums"_a.noconvert(),
          "weights"_a.noconvert(),
          "Add to places how well a picture shows them, and its colours there times that, unless `pixels` is None.");
}

}  // namespace meshreel
