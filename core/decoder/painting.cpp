// Colours of the vertices of a group or of a background. Beside src/meshreel/coding/{colored,appearance/colors}.py.
#include <algorithm>

#include "../src/records.h"
#include "budget.h"
#include "group.h"
#include "meshreel/colors.h"

namespace meshreel {
namespace {

struct Painted {
    std::vector<uint8_t> colors;  // of all meshes, frame after frame, mesh after mesh
    std::vector<double> last;     // of the first mesh, from which the next colours may be predicted
};

void check_colors_cost(const std::vector<ColoredMesh>& canvas, size_t size) {
    double shown = 0, largest = 0;
    for (const ColoredMesh& mesh : canvas) {
        shown += count_of(mesh.vertices) * count_of(mesh.frames);
        largest = std::max(largest, count_of(mesh.vertices));
    }
    require(
        limits::kPainted * shown + limits::kPainting * largest <= limits::kColors + limits::kPerByte * count_of(size),
        "colours that cost more to decode than their bytes may");
}

Painted decode_colors(const mr_bytes& data, const std::vector<ColoredMesh>& canvas, const std::vector<double>& before) {
    check_colors_cost(canvas, data.size);
    Records in(data);
    const VertexColors head = VertexColors::read(in);
    const bool is_predicted = head.origin == Origin::PREVIOUS;
    require(head.form == Form::VERTEX_COLORS, "colours of another form");
    require(head.chroma > 0, "colours whose differences were multiplied by 0");
    require(!is_predicted || !before.empty(), "colours that are predicted from those of a group which is not at hand");
    Painted painted;
    for (size_t number = 0; number < canvas.size(); ++number) {
        const ColoredMesh& mesh = canvas[number];
        const size_t start = in.offset();
        CodedField::read(in);
        for (unsigned level = 0; level < mesh.levels; ++level) ColorsLevel::read(in);
        const mr_bytes records = in.since(start);
        const bool is_known = number == 0 && is_predicted;
        require(!is_known || before.size() == 3 * mesh.vertices,
                "colours that are predicted from those of other vertices");
        const mr_mesh base = mesh.base.view();
        const mr_colored colored{&base,
                                 static_cast<int>(mesh.levels),
                                 mesh.vertices,
                                 mesh.frames,
                                 head.chroma / 64.0,
                                 is_known ? before.data() : nullptr};
        const size_t first = painted.colors.size();
        painted.colors.resize(first + 3 * mesh.frames * mesh.vertices);
        std::vector<double> last(3 * mesh.vertices);
        check(mr_decode_colors(&colored, &records, painted.colors.data() + first, last.data()), "colours: ");
        if (number == 0) painted.last = std::move(last);
    }
    in.finish("colours");
    return painted;
}

}  // namespace

void paint_group(const mr_bytes& data, const Context& context, Continued& made) {
    std::vector<double> before = context.previous ? context.previous->colors : std::vector<double>();
    const size_t shared = made.canvas.empty() ? 0 : 3 * made.canvas[0].vertices;
    if (context.layers != kAllLayers && before.size() > shared) before.resize(shared);  // its levels may be finer
    Painted painted = decode_colors(data, made.canvas, before);
    if (made.state) made.state->colors = std::move(painted.last);
    if (!context.is_shown) return;
    Group& group = made.group;
    auto from = painted.colors.begin() + static_cast<ptrdiff_t>(3 * group.frames * group.vertices);
    for (Mesh& mesh : group.added) {
        const auto end = from + static_cast<ptrdiff_t>(mesh.vertices.size());
        mesh.colors.assign(from, end);
        from = end;
    }
    painted.colors.resize(3 * group.frames * group.vertices);
    group.colors = std::move(painted.colors);
}

void paint_background(const mr_bytes& data, Background& made) {
    const Painted painted = decode_colors(data, {made.added}, {});
    std::vector<uint8_t>& colors = made.mesh.colors;
    const size_t own = painted.colors.size(), all = made.mesh.vertices.size();
    require(own <= all && (own == all || !colors.empty()), "colours of some vertices of a background without colours");
    colors.resize(all - own);
    colors.insert(colors.end(), painted.colors.begin(), painted.colors.end());
}

}  // namespace meshreel
