// The form LAYERS: a coarse mesh and its motion, then for each subdivision a scalar a new vertex and frame. Beside
// src/meshreel/coding/layers/coder.py.
#include <algorithm>

#include "../src/records.h"
#include "budget.h"
#include "draco_mesh.h"
#include "group.h"

namespace meshreel {
namespace {

// The records of a payload, or of its first layers.
struct LayersRecords {
    LayersGroup head;
    std::vector<mr_bytes> layers;  // the LayersGroup, then a LayersLevel for each level
    mr_bytes rest;
    size_t end;

    bool is_alone() const { return head.origin == Origin::ALONE; }
};

LayersRecords read(const mr_bytes& data, int64_t most) {
    LayersRecords found;
    Records in(data);
    found.head = LayersGroup::read(in);
    found.layers.push_back(in.since(0));
    const int64_t levels = most == kAllLayers ? found.head.levels : std::min<int64_t>(most, found.head.levels);
    for (int64_t level = 0; level < levels; ++level) {
        const size_t start = in.offset();
        LayersLevel::read(in);
        found.layers.push_back(in.since(start));
    }
    found.end = in.offset();
    found.rest = in.rest();
    return found;
}

Mesh base_of(const LayersRecords& records, const State* previous) {
    check_step(records.head.step);
    require(records.head.frames > 0, "layers: a group of 0 frames");
    Mesh base;
    if (records.is_alone()) {
        base = decode_draco(records.head.base, records.head.step);
    } else {
        require(previous, "layers: a group that is predicted from one which is not at hand");
        require(records.head.base.size == 0, "layers: a base mesh in a group that has another's");
        base.vertices = previous->base, base.faces = previous->faces;
    }
    check_growth(base, records.head.levels, records.head.frames);
    const unsigned levels = static_cast<unsigned>(records.layers.size() - 1);
    check_cost(layers_cost(base, levels, count_of(records.head.frames)), records.end);
    return base;
}

// Decodes level after level, and keeps what the next group is predicted from.
class Refinement {
public:
    Refinement(const LayersRecords& records, const State* previous, const Mesh& base, const mr_placement& place)
        : frames_(records.head.frames),
          records_(records),
          previous_(records.is_alone() ? nullptr : previous),
          place_(place) {
        faces = base.faces, vertices = base.vertex_count();
        state->faces = base.faces;
    }

    // Positions of the finest level, and the state.
    void decode(const Mesh& base) {
        const mr_mesh view = base.view();
        Block<double> rows(3 * frames_ * vertices);
        check(mr_decode_motion(&records_.layers[0], &view, frames_, rows.data()));
        state->base.resize(3 * vertices);
        for (size_t k = 0; k < state->base.size(); ++k) state->base[k] = rows.data()[k * frames_ + frames_ - 1];
        for (size_t number = 1; number < records_.layers.size(); ++number) {
            const Connectivity& near = next(number);
            const mr_level level = level_of(near, number);
            std::vector<double>& last = state->scalars.back();
            Block<double> finer(3 * frames_ * near.count());
            if (number + 1 < records_.layers.size()) {
                std::copy(rows.begin(), rows.end(), finer.begin());
                check(mr_decode_level(&records_.layers[number], &level, finer.data(), last.data()));
                rows = std::move(finer);
            } else {
                positions = std::move(finer);
                const mr_frames shown{positions.data(), &place_, nullptr};
                check(mr_decode_last_level(&records_.layers[number], &level, rows.data(), last.data(), &shown));
            }
            faces = near.faces, vertices = near.count();
        }
        if (records_.layers.size() > 1) return;
        positions = Block<double>(rows.size());
        const mr_frames shown{positions.data(), &place_, nullptr};
        check(mr_frames_of_rows(rows.data(), frames_, vertices, &shown));
    }

    // The state alone: a fraction of the work.
    void skip(const Mesh& base) {
        const mr_mesh view = base.view();
        state->base.resize(3 * vertices);
        check(mr_decode_last_places(&records_.layers[0], &view, frames_, state->base.data()));
        for (size_t number = 1; number < records_.layers.size(); ++number) {
            const Connectivity& near = next(number);
            const mr_level level = level_of(near, number);
            check(mr_decode_last_scalars(&records_.layers[number], &level, state->scalars.back().data()));
            faces = near.faces, vertices = near.count();
        }
    }

    Faces faces;      // of the finest level
    size_t vertices;  // of it
    Block<double> positions;
    std::shared_ptr<State> state = std::make_shared<State>();

private:
    // The connectivity of a level, which a group that is predicted shares with the one before; room for its scalars.
    const Connectivity& next(size_t number) {
        const bool is_known = previous_ && number <= previous_->finer.size();
        state->finer.push_back(is_known ? previous_->finer[number - 1]
                                        : std::make_shared<const Connectivity>(subdivide(faces, vertices, true)));
        const Connectivity& near = *state->finer.back();
        require(3 * count_of(frames_) * count_of(near.count()) <= limits::kNumbers, "frames of too many numbers");
        state->scalars.emplace_back(near.edge_count());
        return near;
    }

    mr_level level_of(const Connectivity& near, size_t number) const {
        const bool is_known = previous_ && number <= previous_->scalars.size();
        return {frames_,
                near.vertices,
                faces->data(),
                faces->size() / 3,
                near.edges.data(),
                near.edge_count(),
                near.starts.data(),
                near.near.data(),
                is_known ? previous_->scalars[number - 1].data() : nullptr};
    }

    size_t frames_;
    const LayersRecords& records_;
    const State* previous_;
    const mr_placement& place_;
};

}  // namespace

Mesh layers_base(const mr_bytes& data) { return base_of(read(data, 0), nullptr); }

Continued decode_layers(const mr_bytes& data, const Context& context) {
    const LayersRecords records = read(data, context.layers);
    check_frames(records.head.frames, context);
    Continued made;
    const Mesh base = base_of(records, context.previous);
    Refinement refinement(records, context.previous, base, context.place);
    const unsigned levels = static_cast<unsigned>(records.layers.size() - 1);
    if (context.is_shown) refinement.decode(base);
    else refinement.skip(base);
    made.state = refinement.state;
    made.canvas.push_back({base, levels, records.head.frames, refinement.vertices});
    if (!context.is_shown) return made;
    Group& group = made.group;
    group.frames = records.head.frames, group.vertices = refinement.vertices, group.levels = levels;
    group.positions = std::move(refinement.positions), group.faces = refinement.faces;
    if (records.rest.size == 0 || (context.layers != kAllLayers && context.layers <= records.head.levels)) return made;
    decode_patches(records.rest, group);
    Mesh together;
    for (const Mesh& mesh : group.added) append(together, mesh);
    if (!together.vertices.empty()) made.canvas.push_back({together, 0, 1, together.vertex_count()});
    for (Mesh& mesh : group.added) place_all(context.place, mesh.vertices);
    return made;
}

}  // namespace meshreel
