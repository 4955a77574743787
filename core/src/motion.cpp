// Decoding of a field, and of the motion of a group's base mesh.
#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "arrays.h"
#include "field_record.h"
#include "guarded.h"
#include "meshreel/layers.h"
#include "rigid3.h"

namespace meshreel {
namespace {

constexpr int kMostBits = 30;  // of the integers of shared motion: a shift by a diagonal still fits 32 bits

// A turn about the middle of a base mesh, then a shift.
struct Pose {
    Matrix turn;
    Vec shift;
};

// Poses, each coded as its difference from the one before: all shifts, then all turns.
std::vector<Pose> poses_of(const std::vector<double>& numbers) {
    const size_t frames = numbers.size() / 6;
    std::vector<Pose> out;
    Pose pose{identity(), {0, 0, 0}};
    for (size_t t = 0; t < frames; ++t) {
        const double* shift = numbers.data() + 3 * t;
        pose = {product(turn(load(shift + 3 * frames)), pose.turn), pose.shift + load(shift)};
        out.push_back(pose);
    }
    return out;
}

Vec middle_of(const mr_mesh& mesh) {
    Vec sum{0, 0, 0};
    for (size_t v = 0; v < mesh.vertices; ++v) sum = sum + load(mesh.positions + 3 * v);
    const double count = static_cast<double>(mesh.vertices);
    return {sum.x / count, sum.y / count, sum.z / count};
}

// Writes the rows of vertices order[0], order[1] ...: their displacements, frame after frame x, y and z, from their
// places in `base`, or in the poses of it, if there are any. Returns false where a number is not finite.
bool place_rows(FieldRows& field, const int32_t* order, const mr_mesh& base, size_t frames, const Pose* poses,
                double* rows) {
    std::vector<double> block(kRowBlock * 3 * frames);
    const Vec middle = middle_of(base);
    double waste = 0.0;  // of numbers that are not finite: any other number times 0 is 0
    for (size_t first = 0; first < base.vertices; first += kRowBlock) {
        const size_t count = std::min(kRowBlock, base.vertices - first);
        field.next(count, block.data());
        for (size_t p = 0; p < count; ++p) {
            const double* moved = block.data() + 3 * frames * p;
            const size_t v = static_cast<size_t>(order[first + p]);
            double* out = rows + 3 * v * frames;
            const Vec place = load(base.positions + 3 * v);
            for (size_t t = 0; t < frames; ++t) {
                const Vec from = poses ? poses[t].turn * (place - middle) + middle + poses[t].shift : place;
                const Vec now = load(moved + 3 * t) + from;
                out[t] = now.x, out[frames + t] = now.y, out[2 * frames + t] = now.z;
                waste += now.x * 0.0 + now.y * 0.0 + now.z * 0.0;
            }
        }
    }
    return waste == 0.0;
}

// Rows of the frames from the first-th on.
int decode_motion(const LayersGroup& record, const mr_mesh& base, size_t first, double* rows) {
    mr_hierarchy* made = nullptr;
    int status = mr_hierarchy_create(&base, &made);
    if (status != MR_OK) return status;
    const std::unique_ptr<mr_hierarchy, void (*)(mr_hierarchy*)> owner(made, mr_hierarchy_destroy);
    const mr_graph graph = mr_hierarchy_graph(made);
    FieldStreams streams;
    const size_t width = size_t{3} * record.frames;
    const size_t head =
        record.shared == SharedMotion::NONE ? 0 : 1 + (record.shared == SharedMotion::POSES ? 2 : 1) * width;
    status = decode_streams(record.motion, graph, width, head, streams);
    if (status != MR_OK) return status;
    const int bits = head > 0 ? streams.head[0] : 0;
    if (bits < 0 || bits > kMostBits) return MR_BAD_SHARED;
    std::vector<double> shared;
    for (size_t k = 1; k < head; ++k) shared.push_back(std::ldexp(static_cast<double>(streams.head[k]), -bits));
    std::vector<Pose> poses;
    if (record.shared == SharedMotion::POSES) poses = poses_of(shared);
    if (record.shared == SharedMotion::SHIFTS) streams.means = shared;
    FieldRows field(streams.over(graph, 3 * first));
    const Pose* own = poses.empty() ? nullptr : poses.data() + first;
    return place_rows(field, mr_hierarchy_order(made), base, record.frames - first, own, rows) ? MR_OK : MR_NOT_FINITE;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_decode_field(const mr_bytes* record, const mr_graph* graph, size_t width, size_t head, double* rows) {
    if (!is_causal(*graph)) return MR_NOT_CAUSAL;
    CodedField coded;
    if (!parse(*record, coded)) return MR_BAD_RECORD;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        FieldStreams streams;
        const int status = decode_streams(coded, *graph, width, head, streams);
        if (status == MR_OK) FieldRows(streams.over(*graph)).next(graph->count, rows);
        return status;
    });
}

int mr_decode_motion(const mr_bytes* record, const mr_mesh* base, size_t frames, double* rows) {
    LayersGroup group;
    if (!parse(*record, group) || group.form != Form::LAYERS || group.frames != frames) return MR_BAD_RECORD;
    return guarded(MR_NO_MEMORY, [&] { return decode_motion(group, *base, 0, rows); });
}

int mr_decode_last_places(const mr_bytes* record, const mr_mesh* base, size_t frames, double* positions) {
    LayersGroup group;
    if (!parse(*record, group) || group.form != Form::LAYERS || group.frames != frames || frames == 0)
        return MR_BAD_RECORD;
    return guarded(MR_NO_MEMORY, [&] { return decode_motion(group, *base, frames - 1, positions); });
}
