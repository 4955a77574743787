#include <algorithm>
#include <cmath>

#include "../src/records.h"
#include "../src/rigid3.h"
#include "budget.h"
#include "splats.h"

namespace meshreel {
namespace {

constexpr uint8_t kMostBits = 14;
constexpr int32_t kRungs = 200;  // of the ladder of steps
constexpr double kThin = 0.1;    // third scale, along the normal, of the shorter one
constexpr double kPi = 3.14159265358979323846;

void check_head(const Gaussians& head) {
    require(head.form == Form::GAUSSIANS, "splats of another form");
    for (const uint8_t bits : {head.place_bits, head.turn_bits, head.opacity_bits, head.color_bits})
        require(bits >= 1 && bits <= kMostBits, "splats: numbers of too many bits");
    step_of(head.offset_level);
}

int64_t in_range(int64_t value, int64_t most) {
    require(value >= 0 && value <= most, "splats: a number out of its range");
    return value;
}

void read_layer(const GaussiansLayer& layer, const Gaussians& head, size_t faces, std::vector<Splat>& out) {
    const size_t n = static_cast<size_t>(layer.count);
    const auto get = [&](const mr_bytes& stream, size_t rows) { return decode_integers(stream, rows * n); };
    const std::vector<int32_t> skips = get(layer.faces, 1), places = get(layer.places, 2),
                               offsets = get(layer.offsets, 1), turns = get(layer.turns, 1),
                               scales = get(layer.scales, 2), opacities = get(layer.opacities, 1),
                               colors = get(layer.colors, 3);
    const int64_t whole = int64_t{1} << head.place_bits, turn = int64_t{1} << head.turn_bits,
                  full = int64_t{1} << head.opacity_bits;
    const double fine = std::ldexp(1.0, head.color_bits);
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
        splat.rungs[0] = static_cast<uint8_t>(longer), splat.rungs[1] = static_cast<uint8_t>(shorter);
        splat.scales[0] = step_of(static_cast<unsigned>(longer)),
        splat.scales[1] = step_of(static_cast<unsigned>(shorter));
        splat.opacity = static_cast<double>(in_range(opacities[k], full)) / static_cast<double>(full);
        luma += colors[k], orange += colors[n + k], green += colors[2 * n + k];
        const int64_t shares[3] = {luma - green + orange, luma + green, luma - green - orange};
        for (int d = 0; d < 3; ++d) splat.color[d] = std::clamp(static_cast<double>(shares[d]) / fine, 0.0, 1.0);
        out.push_back(splat);
    }
}

Vec unit_of(Vec v) {
    const double length = std::sqrt(dot(v, v));
    return length > 0 ? (1 / length) * v : v;
}

void push(std::vector<double>& out, Vec v) { out.insert(out.end(), {v.x, v.y, v.z}); }

}  // namespace

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

Splats decode_splats(const mr_bytes& data, size_t faces) {
    Records in(data);
    const Gaussians head = Gaussians::read(in);
    check_head(head);
    Splats found;
    std::vector<Splat>& splats = found.all;
    do {
        const GaussiansLayer layer = GaussiansLayer::read(in);
        const uint64_t n = layer.count;
        require(n > 0 && n <= head.count && splats.size() <= head.count - n, "splats: more or fewer than there are");
        check_cost(limits::kSplat * (count_of(splats.size()) + static_cast<double>(n)), data.size);
        read_layer(layer, head, faces, splats);
    } while (in.left() > 0);
    const double growth = found.growth =
        std::sqrt(std::sqrt(static_cast<double>(head.count) / count_of(splats.size())));
    for (Splat& splat : splats) splat.scales[0] *= growth, splat.scales[1] *= growth;
    return found;
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

}  // namespace meshreel
