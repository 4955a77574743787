
#include <algorithm>
#include <cmath>

#include "../src/rigid3.h"
#include "budget.h"
#include "records.h"
#include "video.h"

namespace meshreel {
namespace {

constexpr uint8_t kMostBits = 14;
constexpr int32_t kRungs = 200;  // of the ladder of steps
constexpr double kSplat = 1024;  // cost of one
constexpr double kThin = 0.1;    // third scale, along the normal, of the shorter one
constexpr double kPi = 3.14159265358979323846;

struct SplatsHead {
    uint8_t bits[4];  // of places, turns, opacities, colours
    uint8_t offset_level, scale_level;
    uint64_t count;
};

SplatsHead read_head(Records& in) {
    require(in.u8() == kGaussians, "splats of another form");
    SplatsHead head;
    for (uint8_t& bits : head.bits) {
        bits = in.u8();
        require(bits >= 1 && bits <= kMostBits, "splats: numbers of too many bits");
    }
    head.offset_level = in.u8(), head.scale_level = in.u8(), head.count = in.varint();
    step_of(head.offset_level);
    return head;
}

int64_t in_range(int64_t value, int64_t most) {
    require(value >= 0 && value <= most, "splats: a number out of its range");
    return value;
}

void read_layer(Records& in, const SplatsHead& head, size_t n, size_t faces, std::vector<Splat>& out) {
    const auto get = [&](size_t rows) { return decode_integers(in.blob(in.varint()), rows * n); };
    const std::vector<int32_t> skips = get(1), places = get(2), offsets = get(1), turns = get(1), scales = get(2),
                               opacities = get(1), colors = get(3);
    const int64_t whole = int64_t{1} << head.bits[0], turn = int64_t{1} << head.bits[1],
                  full = int64_t{1} << head.bits[2];
    const double fine = std::ldexp(1.0, head.bits[3]);
    int64_t face = 0, luma = 0, orange = 0, green = 0;
    for (size_t k = 0; k < n; ++k) {
        Splat splat;
        face = in_range(face + skips[k], static_cast<int64_t>(faces) - 1);
        splat.face = static_cast<int32_t>(face);
        const int64_t b = in_range(places[k], whole), c = in_range(places[n + k], whole);
        in_range(b + c, whole);
        splat.weights[0] = static_cast<double>(b) / static_cast<double>(whole);
        splat.weights[1] = static_cast<double>(c) / static_cast<double>(whole);
        splat.offset = offsets[k] * step_of(head.offset_level);
        splat.turn = static_cast<double>(in_range(turns[k], turn - 1)) * (kPi / static_cast<double>(turn));
        const int64_t longer = in_range(int64_t{head.scale_level} + scales[k], kRungs - 1);
        const int64_t shorter = in_range(longer + in_range(scales[n + k], kRungs - 1), kRungs - 1);
        splat.scales[0] = step_of(static_cast<unsigned>(longer)),
        splat.scales[1] = step_of(static_cast<unsigned>(shorter));
        splat.opacity = static_cast<double>(in_range(opacities[k], full)) / static_cast<double>(full);
        luma += colors[k], orange += colors[n + k], green += colors[2 * n + k];
        const int64_t shares[3] = {luma - green + orange, luma + green, luma - green - orange};
        for (int d = 0; d < 3; ++d) splat.color[d] = std::clamp(static_cast<double>(shares[d]) / fine, 0.0, 1.0);
        out.push_back(splat);
    }
}

// Where a splat is after subdivisions: a face, the weights of its corners, and the first edge of the base's face there.
struct Located {
    size_t face;
    double weights[3], along[3];
};

Located locate(const Splat& splat, unsigned levels) {
    size_t face = static_cast<size_t>(splat.face);
    double w[3] = {1 - splat.weights[0] - splat.weights[1], splat.weights[0], splat.weights[1]}, along[3] = {-1, 1, 0};
    for (unsigned level = 0; level < levels; ++level) {
        const size_t child =
            *std::max_element(w, w + 3) < 0.5 ? 3 : static_cast<size_t>(std::max_element(w, w + 3) - w);
        if (child < 3) {
            for (size_t k = 0; k < 3; ++k) w[k] = 2 * w[k] - (k == child ? 1 : 0);
        } else {  // the face in the middle, whose corners are the middles of the edges
            const double turned[3] = {1 - 2 * w[2], 1 - 2 * w[0], 1 - 2 * w[1]};
            const double back[3] = {-along[2], -along[0], -along[1]};
            std::copy_n(turned, 3, w), std::copy_n(back, 3, along);
        }
        face = 4 * face + child;
    }
    return {face, {w[0], w[1], w[2]}, {along[0], along[1], along[2]}};
}

Vec unit_of(Vec v) {
    const double length = std::sqrt(dot(v, v));
    return length > 0 ? (1 / length) * v : v;
}

void push(std::vector<double>& out, Vec v) { out.insert(out.end(), {v.x, v.y, v.z}); }

}  // namespace

std::vector<Splat> decode_splats(const mr_bytes& data, size_t faces) {
    Records in(data);
    const SplatsHead head = read_head(in);
    std::vector<Splat> splats;
    do {
        const uint64_t n = in.varint();
        require(n > 0 && n <= head.count && splats.size() <= head.count - n, "splats: more or fewer than there are");
        check_cost(kSplat * count_of(splats.size() + static_cast<size_t>(n)), data.size);
        read_layer(in, head, static_cast<size_t>(n), faces, splats);
    } while (in.left() > 0);
    const double growth = std::sqrt(std::sqrt(static_cast<double>(head.count) / count_of(splats.size())));
    for (Splat& splat : splats) splat.scales[0] *= growth, splat.scales[1] *= growth;
    return splats;
}

Bound bind_splats(const std::vector<Splat>& splats, const Group& group, size_t t, double unit) {
    Bound bound;
    const double* positions = group.positions.data() + 3 * t * group.vertices;
    for (const Splat& splat : splats) {
        const Located at = locate(splat, group.levels);
        const int32_t* corners = group.faces->data() + 3 * at.face;
        const auto corner = [&](int k) { return load(positions + 3 * static_cast<size_t>(corners[k])); };
        const Vec p = corner(0), q = corner(1), r = corner(2);
        const Vec first = unit_of(at.along[0] * p + at.along[1] * q + at.along[2] * r);
        const Vec normal = unit_of(cross(q - p, r - p)), second = cross(normal, first);
        const double cosine = std::cos(splat.turn), sine = std::sin(splat.turn);
        const bool is_there = dot(first, first) > 0 && dot(normal, normal) > 0 &&
                              (group.dropped.empty() || !group.dropped[t * (group.faces->size() / 3) + at.face]);
        push(bound.means, at.weights[0] * p + at.weights[1] * q + at.weights[2] * r + (unit * splat.offset) * normal);
        push(bound.axes, cosine * first + sine * second);
        push(bound.axes, cosine * second - sine * first);
        push(bound.axes, normal);
        bound.scales.insert(bound.scales.end(),
                            {unit * splat.scales[0], unit * splat.scales[1], kThin * unit * splat.scales[1]});
        bound.opacities.push_back(is_there ? splat.opacity : 0.0);
        bound.colors.insert(bound.colors.end(), splat.color, splat.color + 3);
    }
    return bound;
}

// The chunk of the splats that a group has: its own, or those of a group before it.
uint32_t Video::splats_of(uint32_t chunk) const {
    for (; chunk != kNoChunk; chunk = head.group_before(chunk)) {
        const uint8_t form = head.chunks[chunk].form;
        if (form != kLayers && form != kLaplacian) return kNoChunk;
        const uint32_t found = head.companion_of(chunk, kSplatsOf);
        if (found != kNoChunk) return found;
    }
    return kNoChunk;
}

Bound Video::splats(uint64_t frame, size_t track) {
    lacking.clear();
    const uint32_t chunk = head.chunk_of_frame(frame, track), of = splats_of(chunk);
    if (of == kNoChunk) return Bound();
    const Group& group = group_of(frame, track);
    if (splats_.chunk != of) {
        refused_.check(of);
        const uint32_t owner = static_cast<uint32_t>(head.chunks[of].depends_on[0]);
        const std::vector<uint8_t> first = read(owner, 0), data = read(of, layers_);
        splats_ = {};
        splats_.faces = refused_.of(head, of, [&] { return base_mesh(view(first)).face_count(); });
        splats_.all = refused_.of(head, of, [&] { return decode_splats(view(data), splats_.faces); });
        splats_.chunk = of;
    }
    const double corners = 3 * std::ldexp(count_of(splats_.faces), 2 * static_cast<int>(group.levels));
    if (count_of(group.faces->size()) != corners) return Bound();  // they are of another mesh
    const size_t t = static_cast<size_t>(frame - head.chunks[chunk].first_frame);
    return bind_splats(splats_.all, group, t, head.header.scale);
}

}  // namespace meshreel
