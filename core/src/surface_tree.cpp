#include "surface_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "arrays.h"
#include "guarded.h"
#include "lanes.h"
#include "tree_handle.h"

namespace meshreel {
namespace {

constexpr int kBins = 16;       // of centroids, at whose borders a box may be split
constexpr int kCurveBits = 10;  // per coordinate, of the cells along the curve
// Nodes on a path. A node halves twice; a half has either half of its faces, or its size shrinks by a bin at least,
// which 2^252, the range of single precision, allows 63 times an axis at 16 bins; and halving 2^31 faces takes 31.
constexpr int kDeepest = 128;
constexpr double kSlack = 1e-6;  // error of a distance in single precision, and more, in distances from the origin
// Squared sine of a face's angle: below, rounding leaves nothing of the inside, and the edges answer (guess).
constexpr double kThin = 1e-10;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

float inverse(float x) { return x > std::numeric_limits<float>::min() ? 1.0f / x : 0.0f; }
double shortened(double t) { return t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t; }

struct Bounds {  // of three lanes; the fourth counts for nothing
    Lanes low = lanes(kInfinity), high = lanes(-kInfinity);

    void add(Lanes p) { low = smaller(p, low), high = larger(p, high); }
    void add(const Bounds& other) { low = smaller(other.low, low), high = larger(other.high, high); }
    float area() const {
        const Lanes size = high - low;
        return size[0] < 0.0f ? 0.0f : size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
    }
};

uint32_t cell_of(double x) {
    constexpr double last = (1 << kCurveBits) - 1;
    return static_cast<uint32_t>(x > 0.0 ? std::min(x, last) : 0.0);  // 0 for NaN
}

uint32_t spread(uint32_t cell) {  // two zeros between its bits
    cell = (cell | cell << 16) & 0x030000FFu;
    cell = (cell | cell << 8) & 0x0300F00Fu;
    cell = (cell | cell << 4) & 0x030C30C3u;
    return (cell | cell << 2) & 0x09249249u;
}

// Numbers of the queries, along a curve through the cells of their box.
std::vector<uint32_t> along_curve(const double* queries, size_t count) {
    double low[3], size = 0.0;
    for (size_t d = 0; d < 3; ++d) {
        double high = low[d] = queries[d];
        for (size_t k = 0; k < count; ++k)
            low[d] = std::min(low[d], queries[3 * k + d]), high = std::max(high, queries[3 * k + d]);
        size = std::max(size, high - low[d]);
    }
    const double scale = size > 0.0 && std::isfinite(size) ? ((1 << kCurveBits) - 1) / size : 0.0;
    std::vector<uint64_t> keyed(count);
    for (size_t k = 0; k < count; ++k) {
        uint32_t code = 0;
        for (size_t d = 0; d < 3; ++d) code |= spread(cell_of((queries[3 * k + d] - low[d]) * scale)) << d;
        keyed[k] = static_cast<uint64_t>(code) << 32 | k;
    }
    std::sort(keyed.begin(), keyed.end());
    std::vector<uint32_t> order(count);
    for (size_t k = 0; k < count; ++k) order[k] = static_cast<uint32_t>(keyed[k]);
    return order;
}

}  // namespace

SurfaceTree::SurfaceTree(const mr_mesh& mesh) : vertices_(mesh.vertices), faces_(mesh.face_count) {
    for (size_t f = 0; f < mesh.face_count; ++f)
        faces_[f] = {mesh.faces[3 * f], mesh.faces[3 * f + 1], mesh.faces[3 * f + 2]};
    const Span span = span_of(mesh.positions);
    origin_ = span.middle;
    slack_ = kSlack * std::sqrt(dot(span.half, span.half));
    positions_.resize(3 * vertices_);
    for (size_t v = 0; v < vertices_; ++v) store(&positions_[3 * v], load(mesh.positions + 3 * v) - origin_);
    middles_.resize(faces_.size());
    apart_.resize(faces_.size());
    for (size_t f = 0; f < faces_.size(); ++f) {
        const int32_t face = static_cast<int32_t>(f);
        const Vec m = (1.0 / 3.0) * (corner(face, 0) + corner(face, 1) + corner(face, 2));
        middles_[f] = {{static_cast<float>(m.x), static_cast<float>(m.y), static_cast<float>(m.z), 0.0f}, face};
    }
    root_ = build({0, static_cast<int32_t>(faces_.size())});
    for (size_t n = nodes_.size(); n-- > 0;) refit(nodes_[n]);
    middles_ = {}, apart_ = {};
    nodes_.shrink_to_fit(), blocks_.shrink_to_fit();  // a frame keeps its tree for long
}

SurfaceTree::Span SurfaceTree::span_of(const double* positions) const {
    Vec low = load(positions + 3 * static_cast<size_t>(faces_[0][0])), high = low;
    for (const auto& face : faces_)
        for (int32_t v : face) {
            const Vec p = load(positions + 3 * static_cast<size_t>(v));
            low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
            high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
        }
    const Vec middle = 0.5 * (low + high);
    return {middle, high - middle};
}

void SurfaceTree::move(const double* positions) {
    const auto [middle, half] = span_of(positions);
    if (dot(middle - origin_, middle - origin_) > dot(half, half)) origin_ = middle;  // else rounding stays as it was
    slack_ = kSlack * (std::sqrt(dot(half, half)) + std::sqrt(dot(middle - origin_, middle - origin_)));
    for (size_t v = 0; v < vertices_; ++v) store(&positions_[3 * v], load(positions + 3 * v) - origin_);
    for (Block& block : blocks_) fill(block);
    for (size_t n = nodes_.size(); n-- > 0;) refit(nodes_[n]);
}

// Depth is bounded: a range whose middles are one point is halved by number.
int32_t SurfaceTree::build(Range range) {
    if (range.end - range.begin <= kWide) return leaf(range);
    const std::vector<Range> parts = children(range);
    const size_t number = nodes_.size();
    nodes_.emplace_back();
    std::fill(nodes_[number].child, nodes_[number].child + kWide, kNothing);
    for (size_t k = 0; k < parts.size(); ++k) {
        const int32_t child = build(parts[k]);
        nodes_[number].child[k] = child;
    }
    return static_cast<int32_t>(number);
}

std::vector<SurfaceTree::Range> SurfaceTree::children(Range range) {
    const Range left = halved(range), right{left.end, range.end};
    std::vector<Range> parts;
    for (Range half : {left, right}) {
        if (half.end - half.begin <= kWide) {
            parts.push_back(half);
            continue;
        }
        const Range quarter = halved(half);
        parts.push_back(quarter);
        parts.push_back({quarter.end, half.end});
    }
    return parts;
}

// Sorts a range into two by the surface area heuristic over bins of middles; returns the first. A leaf costs the same
// however full it is.
SurfaceTree::Range SurfaceTree::halved(Range range) {
    const auto leaves = [](int32_t count) { return static_cast<float>((count + kWide - 1) / kWide); };
    Bounds all;
    for (int32_t k = range.begin; k < range.end; ++k) all.add(load_lanes(middles_[k].at));
    int axis = 0;
    for (int d = 1; d < 3; ++d)
        if (all.high[d] - all.low[d] > all.high[axis] - all.low[axis]) axis = d;
    const float size = all.high[axis] - all.low[axis], scale = size > 0.0f ? kBins / size : 0.0f;
    const float low = all.low[axis];
    const auto bin_of = [&](const Middle& middle) {
        const float place = (middle.at[axis] - low) * scale;
        return place < kBins - 1 ? static_cast<int>(place) : kBins - 1;  // the last for NaN, too
    };
    const int32_t middle = range.begin + (range.end - range.begin) / 2;
    if (!(scale > 0.0f) || !std::isfinite(scale)) return {range.begin, middle};
    Bounds bins[kBins];
    int32_t counts[kBins] = {};
    for (int32_t k = range.begin; k < range.end; ++k) {
        const int bin = bin_of(middles_[k]);
        bins[bin].add(load_lanes(middles_[k].at));
        ++counts[bin];
    }
    float costs[kBins] = {}, least = kInfinity;
    int best = 0;
    Bounds side;
    int32_t count = 0;
    for (int b = 0; b + 1 < kBins; ++b) {
        side.add(bins[b]), count += counts[b];
        costs[b] = side.area() * leaves(count);
    }
    side = {}, count = 0;
    for (int b = kBins - 1; b-- > 0;) {
        side.add(bins[b + 1]), count += counts[b + 1];
        costs[b] += side.area() * leaves(count);
        if (costs[b] < least) least = costs[b], best = b;
    }
    int32_t at = range.begin, others = 0;
    for (int32_t k = range.begin; k < range.end; ++k) {
        const Middle own = middles_[k];
        if (bin_of(own) <= best) middles_[at++] = own;
        else apart_[others++] = own;
    }
    std::copy(apart_.begin(), apart_.begin() + others, middles_.begin() + at);
    return {range.begin, at == range.begin || at == range.end ? middle : at};
}

int32_t SurfaceTree::leaf(Range range) {
    Block block;
    for (int k = 0; k < kWide; ++k) block.face[k] = middles_[std::min(range.begin + k, range.end - 1)].face;
    fill(block);
    blocks_.push_back(block);
    return ~static_cast<int32_t>(blocks_.size() - 1);
}

void SurfaceTree::fill(Block& block) const {
    for (int k = 0; k < kWide; ++k) {
        const Vec a = corner(block.face[k], 0), e = corner(block.face[k], 1) - a, f = corner(block.face[k], 2) - a;
        const double* rows[3] = {&a.x, &e.x, &f.x};
        for (int d = 0; d < 3; ++d) {
            block.a[d][k] = static_cast<float>(rows[0][d]);
            block.e[d][k] = static_cast<float>(rows[1][d]);
            block.f[d][k] = static_cast<float>(rows[2][d]);
        }
        const double ee = dot(e, e), ef = dot(e, f), ff = dot(f, f);
        block.ee[k] = static_cast<float>(ee), block.ef[k] = static_cast<float>(ef);
        block.ff[k] = static_cast<float>(ff);
        block.by_ee[k] = inverse(block.ee[k]), block.by_ff[k] = inverse(block.ff[k]);
        block.by_gg[k] = inverse(static_cast<float>(dot(f - e, f - e)));
        block.by_det[k] = inverse(static_cast<float>(ee * ff - ef * ef));
    }
}

SurfaceTree::Box SurfaceTree::box_of(const Block& block) const {
    Box box;
    for (int d = 0; d < 3; ++d) {
        box.low[d] = kInfinity, box.high[d] = -kInfinity;
        for (int k = 0; k < kWide; ++k) {
            const float a = block.a[d][k], b = a + block.e[d][k], c = a + block.f[d][k];
            box.low[d] = std::min(box.low[d], std::min(a, std::min(b, c)));
            box.high[d] = std::max(box.high[d], std::max(a, std::max(b, c)));
        }
    }
    return box;
}

SurfaceTree::Box SurfaceTree::box_of(int32_t child) const {
    if (child < 0) return box_of(blocks_[static_cast<size_t>(~child)]);
    const Node& node = nodes_[static_cast<size_t>(child)];
    Box box;
    for (int d = 0; d < 3; ++d) {
        box.low[d] = *std::min_element(node.low[d], node.low[d] + kWide);
        box.high[d] = *std::max_element(node.high[d], node.high[d] + kWide);
    }
    return box;
}

void SurfaceTree::refit(Node& node) const {
    for (int k = 0; k < kWide; ++k) {
        Box box = {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
        if (node.child[k] != kNothing) box = box_of(node.child[k]);
        for (int d = 0; d < 3; ++d) node.low[d][k] = box.low[d], node.high[d][k] = box.high[d];
    }
}

// The smallest squared distance to a triangle of the block, or `best` if that is less. Of equally close faces the one
// with the least number counts, so that no answer depends on the way to it.
float SurfaceTree::visit(const Block& block, const float* query, const uint8_t* gone, float best, int32_t& face) const {
    float squared[kWide];
    for (int k = 0; k < kWide; ++k) {
        const float x = query[0] - block.a[0][k], y = query[1] - block.a[1][k], z = query[2] - block.a[2][k];
        const float ex = block.e[0][k], ey = block.e[1][k], ez = block.e[2][k];
        const float fx = block.f[0][k], fy = block.f[1][k], fz = block.f[2][k];
        const float pe = x * ex + y * ey + z * ez, pf = x * fx + y * fy + z * fz;
        const float ee = block.ee[k], ef = block.ef[k], ff = block.ff[k];
        const auto along = [](float t) { return t < 0.0f ? 0.0f : t > 1.0f ? 1.0f : t; };
        const auto left = [&](float v, float w) {  // of the squared distance to a + v e + w f
            const float dx = x - v * ex - w * fx, dy = y - v * ey - w * fy, dz = z - v * ez - w * fz;
            return dx * dx + dy * dy + dz * dz;
        };
        float v = (ff * pe - ef * pf) * block.by_det[k], w = (ee * pf - ef * pe) * block.by_det[k];
        {  // once more for what is left: on thin faces, single precision leaves a tenth of their length
            const float rx = x - v * ex - w * fx, ry = y - v * ey - w * fy, rz = z - v * ez - w * fz;
            const float re = rx * ex + ry * ey + rz * ez, rf = rx * fx + ry * fy + rz * fz;
            v += (ff * re - ef * rf) * block.by_det[k], w += (ee * rf - ef * re) * block.by_det[k];
        }
        const float t = along((pf - pe - ef + ee) * block.by_gg[k]);
        const float ab = left(along(pe * block.by_ee[k]), 0.0f), ac = left(0.0f, along(pf * block.by_ff[k]));
        const float bc = left(1.0f - t, t), inner = left(v, w);
        float least = ab < ac ? ab : ac;
        least = bc < least ? bc : least;
        const bool inside = (v >= 0.0f) & (w >= 0.0f) & (v + w <= 1.0f) & (inner < least);
        squared[k] = inside ? inner : least;
    }
    for (int k = 0; k < kWide; ++k) {
        if (gone != nullptr && gone[block.face[k]]) continue;
        if (squared[k] < best || (squared[k] == best && block.face[k] < face)) best = squared[k], face = block.face[k];
    }
    return best;
}

// The closest point of a face, in double precision (Ericson, Real-Time Collision Detection, 5.1.5).
Hit SurfaceTree::exact(Vec query, int32_t face) const {
    const Vec a = corner(face, 0), e = corner(face, 1) - a, f = corner(face, 2) - a, p = query - a;
    const double ee = dot(e, e), ef = dot(e, f), ff = dot(f, f), pe = dot(p, e), pf = dot(p, f);
    const double det = ee * ff - ef * ef, v = ff * pe - ef * pf, w = ee * pf - ef * pe;
    if (det > kThin * ee * ff && v >= 0.0 && w >= 0.0 && v + w <= det)
        return {face, {1.0 - v / det - w / det, v / det, w / det}};
    const double gg = ee - 2.0 * ef + ff;
    const double ab = ee > 0.0 ? shortened(pe / ee) : 0.0, ac = ff > 0.0 ? shortened(pf / ff) : 0.0;
    const double bc = gg > 0.0 ? shortened((pf - pe - ef + ee) / gg) : 0.0;
    const double candidates[3][3] = {{1.0 - ab, ab, 0.0}, {1.0 - ac, 0.0, ac}, {0.0, 1.0 - bc, bc}};
    Hit hit{face, {1.0, 0.0, 0.0}};
    double least = std::numeric_limits<double>::infinity();
    for (const auto& c : candidates) {
        const Vec gap = p - c[1] * e - c[2] * f;
        if (dot(gap, gap) < least) least = dot(gap, gap), hit.weights = {c[0], c[1], c[2]};
    }
    return hit;
}

Hit SurfaceTree::closest(Vec query, double reach, int32_t guess, const uint8_t* gone) const {
    const Vec local = query - origin_;
    const float p[3] = {static_cast<float>(local.x), static_cast<float>(local.y), static_cast<float>(local.z)};
    float best = static_cast<float>(reach * reach);
    int32_t face = INT32_MAX;
    if (guess >= 0 && (gone == nullptr || !gone[guess])) {  // a bound, a little above what `visit` finds
        const Hit start = exact(local, guess);
        const Vec a = corner(guess, 0), b = corner(guess, 1), c = corner(guess, 2);
        const Vec gap = start.weights[0] * a + start.weights[1] * b + start.weights[2] * c - local;
        const double bound = std::sqrt(dot(gap, gap)) + slack_;
        if (bound * bound < best) best = static_cast<float>(bound * bound);
    }
    struct Waiting {
        float squared;
        int32_t child;
    };
    Waiting stack[3 * kDeepest + kWide];
    int size = 0;
    stack[size++] = {0.0f, root_};
    while (size > 0) {
        const Waiting next = stack[--size];
        if (!(next.squared <= best)) continue;
        if (next.child < 0) {
            best = visit(blocks_[static_cast<size_t>(~next.child)], p, gone, best, face);
            continue;
        }
        const Node& node = nodes_[static_cast<size_t>(next.child)];
        Lanes all = lanes(0.0f);
        for (int d = 0; d < 3; ++d) {
            const Lanes below = load_lanes(node.low[d]) - lanes(p[d]), above = lanes(p[d]) - load_lanes(node.high[d]);
            const Lanes out = larger(larger(below, above), lanes(0.0f));
            all = all + out * out;
        }
        float squared[kWide];
        store_lanes(squared, all);
        const int first = size;
        for (int k = 0; k < kWide; ++k) {  // without branches, which no processor would foresee
            stack[size] = {squared[k], node.child[k]};
            size += (squared[k] <= best) & (node.child[k] != kNothing);  // NaN is as near to nothing as to all
        }
        for (int at = first; at + 1 < size; ++at)  // the nearest last, which is asked first
            if (stack[at].squared < stack[size - 1].squared) std::swap(stack[at], stack[size - 1]);
    }
    if (face == INT32_MAX && std::isinf(reach)) {  // of a query that is not finite, or too far for single precision
        face = std::max(guess, 0);
        if (gone != nullptr && gone[face])
            face = static_cast<int32_t>(std::find(gone, gone + faces_.size(), 0) - gone) %
                   static_cast<int32_t>(faces_.size());
    }
    return face == INT32_MAX ? Hit{-1, {}} : exact(local, face);
}

void SurfaceTree::closest(const double* queries, size_t count, double reach, const uint8_t* gone, int32_t* faces,
                          double* weights) const {
    int32_t before = -1;
    const auto ask = [&](size_t k) {
        const Hit hit = closest(load(queries + 3 * k), reach, faces[k] >= 0 ? faces[k] : before, gone);
        faces[k] = hit.face;
        std::copy(hit.weights.begin(), hit.weights.end(), weights + 3 * k);
        before = hit.face;
    };
    for (uint32_t k : along_curve(queries, count)) ask(k);
}

}  // namespace meshreel

using namespace meshreel;

int mr_tree_create(const mr_mesh* mesh, mr_tree** out) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (mesh == nullptr || mesh->face_count == 0 || mesh->face_count > INT32_MAX) return MR_BAD_INPUT;
        if (!in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices)) return MR_BAD_INPUT;
        *out = new mr_tree{SurfaceTree(*mesh)};
        return MR_OK;
    });
}

void mr_tree_destroy(mr_tree* tree) { delete tree; }

int mr_tree_move(mr_tree* tree, const double* positions) {
    tree->tree.move(positions);
    return MR_OK;
}

int mr_tree_closest(const mr_tree* tree, const double* queries, size_t count, double reach, const uint8_t* gone,
                    int32_t* faces, double* weights) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (count > UINT32_MAX) return MR_BAD_INPUT;
        for (size_t k = 0; k < count; ++k)
            if (faces[k] >= static_cast<int64_t>(tree->tree.face_count())) return MR_BAD_INPUT;
        if (count > 0) tree->tree.closest(queries, count, reach, gone, faces, weights);
        return MR_OK;
    });
}
