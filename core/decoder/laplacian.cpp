// The form LAPLACIAN: a reference mesh and displacements of it. Beside src/meshreel/coding/paper.
#include "meshreel/laplacian.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "../src/records.h"
#include "budget.h"
#include "draco_mesh.h"
#include "group.h"
#include "meshreel/entropy.h"

namespace meshreel {
namespace {

constexpr int kMostBits = 30;  // fraction bits of the mean and of a direction
// The head, checked, and the offset of the first stream.
std::pair<DisplacementHead, size_t> read_head(const mr_bytes& data) {
    Records in(data);
    const DisplacementHead head = DisplacementHead::read(in);
    require(head.frames > 0 && head.components.size() <= 3 * size_t{head.frames},
            "displacements: more components than there can be");
    require(head.anchor_weight > 0 && head.mean_bits <= kMostBits, "displacements: a head that is damaged");
    for (const Component& part : head.components) {
        require(part.basis_bits <= kMostBits, "displacements: too many bits");
        step_of(part.step_level);
    }
    return {head, in.offset()};
}

// For each vertex the first one of its connected component.
std::vector<int32_t> roots_of(const Mesh& mesh) {
    std::vector<int32_t> roots(mesh.vertex_count());
    std::iota(roots.begin(), roots.end(), 0);
    const auto find = [&](int32_t v) {
        while (roots[v] != v) v = roots[v] = roots[roots[v]];
        return v;
    };
    for (size_t f = 0; f < mesh.face_count(); ++f)
        for (size_t k = 1; k < 3; ++k) {
            const int32_t a = find((*mesh.faces)[3 * f]), b = find((*mesh.faces)[3 * f + k]);
            roots[std::max(a, b)] = std::min(a, b);
        }
    for (int32_t& root : roots) root = find(root);
    return roots;
}

std::vector<int32_t> spread_anchors(const Mesh& base, uint64_t count) {
    const size_t vertices = base.vertex_count();
    const std::vector<int32_t> roots = roots_of(base);
    std::vector<uint8_t> is_chosen(vertices), is_served(vertices), is_used(vertices);
    for (const int32_t v : *base.faces) is_used[static_cast<size_t>(v)] = 1;
    for (uint64_t k = 0; k < count; ++k) {
        const size_t v = static_cast<size_t>(k * vertices / count);
        is_chosen[v] = is_served[static_cast<size_t>(roots[v])] = 1;
    }
    std::vector<int32_t> anchors;
    for (size_t v = 0; v < vertices; ++v) {
        const bool is_first = static_cast<size_t>(roots[v]) == v && !is_served[v];
        if ((is_chosen[v] || is_first) && is_used[v]) anchors.push_back(static_cast<int32_t>(v));
    }
    return anchors;
}

std::vector<int32_t> anchors_of(const DisplacementHead& head, const Mesh& base) {
    if (head.anchor_rule == AnchorRule::SPREAD) return spread_anchors(base, head.anchor_count);
    std::vector<int32_t> anchors(base.vertex_count());
    const int64_t vertices = static_cast<int64_t>(base.vertex_count()), faces = static_cast<int64_t>(base.face_count());
    const int64_t wanted = static_cast<int64_t>(head.anchor_count);
    const int64_t count = mr_farthest_anchors(base.faces->data(), faces, vertices, wanted, anchors.data());
    require(count >= 0, "displacements: a face that names none of the vertices");
    anchors.resize(static_cast<size_t>(count));
    return anchors;
}

// For each vertex its neighbours with a smaller number, sorted.
void causal_neighbours(const Mesh& base, std::vector<int64_t>& starts, std::vector<int32_t>& near) {
    const Connectivity cut = subdivide(base.faces, base.vertex_count(), false);  // edges, sorted by both ends
    starts.assign(base.vertex_count() + 1, 0);
    const auto is_edge = [&](size_t e) { return cut.edges[2 * e] != cut.edges[2 * e + 1]; };
    for (size_t e = 0; e < cut.edge_count(); ++e)
        if (is_edge(e)) ++starts[static_cast<size_t>(cut.edges[2 * e + 1]) + 1];
    for (size_t v = 1; v < starts.size(); ++v) starts[v] += starts[v - 1];
    near.resize(static_cast<size_t>(starts.back()));
    std::vector<int64_t> next(starts.begin(), starts.end() - 1);
    for (size_t e = 0; e < cut.edge_count(); ++e)
        if (is_edge(e)) near[static_cast<size_t>(next[static_cast<size_t>(cut.edges[2 * e + 1])]++)] = cut.edges[2 * e];
}

// Deltas and below them the anchors' values: (vertices + anchors) rows of a number a component.
std::vector<double> decode_deltas(const DisplacementHead& head, size_t columns, Records& in, const Mesh& base,
                                  size_t anchors) {
    const size_t vertices = base.vertex_count();
    std::vector<double> deltas((vertices + anchors) * columns);
    std::vector<uint8_t> streams;
    std::vector<size_t> sizes;
    for (size_t c = 0; c < columns; ++c) {
        const Component& part = head.components[c];
        const double step = step_of(part.step_level);
        const std::vector<int32_t> fixed = decode_integers(in.blob(part.anchors_size), anchors);
        for (size_t a = 0; a < anchors; ++a) deltas[(vertices + a) * columns + c] = fixed[a] * step;
        const mr_bytes stream = in.blob(part.deltas_size);
        check_plausible(vertices, stream.size);
        streams.insert(streams.end(), stream.data, stream.data + stream.size);
        sizes.push_back(stream.size);
    }
    std::vector<int64_t> starts;
    std::vector<int32_t> near, symbols(vertices * columns);
    causal_neighbours(base, starts, near);
    const mr_weights weights{symbols.data(), vertices, columns, starts.data(), near.data(), near.size()};
    size_t failed = 0;
    check(mr_decode_weights(&weights, streams.data(), sizes.data(), &failed), "displacements: ");
    for (size_t c = 0; c < columns; ++c) {
        const double step = step_of(head.components[c].step_level);
        for (size_t v = 0; v < vertices; ++v) deltas[v * columns + c] = symbols[c * vertices + v] * step;
    }
    return deltas;
}

Mesh reference_of(const LaplacianGroup& record) {
    require(record.form == Form::LAPLACIAN, "a group of another form than LAPLACIAN");
    check_step(record.step);
    return decode_draco(record.reference, record.step);
}

// vertices x frames x 3 numbers, from at most so many components.
std::vector<double> decode_displacements(const mr_bytes& data, const Mesh& base, int64_t most) {
    const auto [head, end] = read_head(data);
    const size_t all = head.components.size(), vertices = base.vertex_count(), width = 3 * size_t{head.frames};
    const size_t count =
        most == kAllLayers ? all : static_cast<size_t>(std::min<uint64_t>(static_cast<uint64_t>(most), all));
    require(head.anchor_count <= vertices, "displacements: more anchors than vertices");
    require(count_of(width) * count_of(vertices) <= limits::kNumbers, "displacements: too many numbers");
    const std::vector<int32_t> anchors = anchors_of(head, base);
    Records in({data.data + end, data.size - end});
    const std::vector<double> deltas = decode_deltas(head, count, in, base, anchors.size());
    if (most == kAllLayers) in.finish("displacements");
    const mr_mesh view = base.view();
    std::vector<double> weights(vertices * count);
    check(mr_laplacian_solve(&view, anchors.data(), static_cast<int64_t>(anchors.size()), head.anchor_weight,
                             deltas.data(), static_cast<int64_t>(count), weights.data()),
          "displacements: the base's least squares have no solution: ");
    const std::vector<int32_t> numbers = decode_integers(head.basis, width * (1 + all));
    std::vector<double> mean(width), vectors(width * count), field(vertices * width);
    for (size_t k = 0; k < width; ++k) mean[k] = std::ldexp(static_cast<double>(numbers[k]), -head.mean_bits);
    for (size_t k = 0; k < vectors.size(); ++k)
        vectors[k] = std::ldexp(static_cast<double>(numbers[width + k]), -head.components[k / width].basis_bits);
    mr_klt_inverse(weights.data(), static_cast<int64_t>(vertices), static_cast<int64_t>(count), vectors.data(),
                   mean.data(), static_cast<int64_t>(width), field.data());
    return field;
}

}  // namespace

Mesh laplacian_base(const mr_bytes& data) { return reference_of(read_all<LaplacianGroup>(data, "LaplacianGroup")); }

Continued decode_laplacian(const mr_bytes& data, const Context& context) {
    const LaplacianGroup record = read_all<LaplacianGroup>(data, "LaplacianGroup");
    const Mesh reference = reference_of(record);
    const unsigned levels = record.levels;
    const DisplacementHead head = read_head(record.displacements).first;
    check_frames(head.frames, context);
    check_growth(reference, levels, head.frames);
    check_cost(laplacian_cost(reference, levels, count_of(head.frames), count_of(head.components.size())), data.size);
    const Mesh base = subdivide_midpoint(reference, levels);
    const std::vector<double> field = decode_displacements(record.displacements, base, context.layers);
    Continued made;
    Group& group = made.group;
    const size_t frames = group.frames = head.frames, vertices = group.vertices = base.vertex_count();
    group.faces = base.faces, group.levels = levels;
    group.positions = Block<double>(field.size());
    double* positions = group.positions.data();
    for (size_t v = 0; v < vertices; ++v)
        for (size_t t = 0; t < frames; ++t)
            for (size_t k = 0; k < 3; ++k)
                positions[3 * (t * vertices + v) + k] = base.vertices[3 * v + k] + field[3 * (v * frames + t) + k];
    place_all(context.place, positions, group.positions.size());
    made.canvas.push_back({reference, levels, frames, vertices});
    return made;
}

}  // namespace meshreel
