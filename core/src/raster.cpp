// A z-buffer. Corners are rounded to a lattice of 1/256 pixel; edge functions on it are whole numbers, and a pixel
// whose middle lies on an edge belongs to the face that has it as a top or left one: so faces that share an edge leave
// no gap and cover no pixel twice. Depth is that of the face's own plane, in double precision.
#include "meshreel/raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "arrays.h"
#include "guarded.h"
#include "rigid3.h"
#include "scratch.h"

namespace meshreel {
namespace {

constexpr int kBits = 8;  // of a pixel's fractions
constexpr int64_t kPixel = 1 << kBits;
constexpr double kReach = 1 << 16;  // pixels from a crop's corner; farther parts of faces are cut off: products fit
constexpr int32_t kLargest = 1 << 15;
constexpr double kNear = 1e-12;  // of the farthest corner's depth: what is nearer to the eye's plane is cut off
constexpr int kMostCorners = 3 + 5;

struct Corner {
    int64_t x, y;  // in 1/256 pixel
    bool is_nowhere() const { return x == std::numeric_limits<int64_t>::min(); }
};

constexpr Corner kNowhere{std::numeric_limits<int64_t>::min(), 0};  // behind the eye, or too far from the crop

// Pixels around a triangle, the last ones included, and whether its corners turn the other way.
struct Pixels {
    int64_t left = 0, right = -1, top = 0, bottom = -1;
    bool is_turned = false;
    bool is_empty() const { return left > right || top > bottom; }
};

// Nearness as a linear function of a pixel's column and row, within the corners' range: 1 / z, or -z of parallel rays.
struct Nearness {
    double across, down, first, least, most;
    double at(double column, double row) const {
        return std::min(std::max(across * column + (down * row + first), least), most);
    }
};

class Raster {
public:
    Raster(const mr_mesh& mesh, const mr_viewer& viewer, const mr_crop& crop)
        : mesh_(mesh),
          viewer_(viewer),
          crop_(crop),
          corners_(scratch<Vec>(mesh.vertices)),
          spots_(scratch<Corner>(mesh.vertices)) {
        const Matrix turn{{load(viewer.turn), load(viewer.turn + 3), load(viewer.turn + 6)}};
        double farthest = 0;
        for (size_t v = 0; v < mesh.vertices; ++v) {
            corners_[v] = turn * load(mesh.positions + 3 * v) + load(viewer.shift);
            farthest = std::max(farthest, corners_[v].z);
        }
        near_ = std::max(kNear * farthest, std::numeric_limits<double>::min());
        center_[0] = viewer.center[0] - crop.left, center_[1] = viewer.center[1] - crop.top;
        for (size_t v = 0; v < mesh.vertices; ++v) spots_[v] = is_within(corners_[v]) ? placed(corners_[v]) : kNowhere;
    }

    void draw(int32_t* faces, double* nearness) const {
        for (size_t f = 0; f < mesh_.face_count; ++f) {
            const Corner own[3] = {spot(f, 0), spot(f, 1), spot(f, 2)};
            const bool is_whole = !own[0].is_nowhere() && !own[1].is_nowhere() && !own[2].is_nowhere();
            const Pixels whole = is_whole ? pixels_of(own) : Pixels{};
            if (is_whole && whole.is_empty()) continue;
            Vec polygon[kMostCorners];
            for (int k = 0; k < 3; ++k) polygon[k] = corner(f, k);
            const Nearness plane = nearness_of(polygon);
            const int count = is_whole ? 3 : clipped(polygon);
            const Nearness depth = limited(plane, polygon, count);
            if (is_whole) fill(own, whole, depth, static_cast<int32_t>(f), faces, nearness);
            for (int k = 2; k < count && !is_whole; ++k) {
                const Corner part[3] = {placed(polygon[0]), placed(polygon[k - 1]), placed(polygon[k])};
                fill(part, pixels_of(part), depth, static_cast<int32_t>(f), faces, nearness);
            }
        }
    }

    double depth(double nearness) const { return viewer_.parallel ? -nearness : 1 / nearness; }

    // The weights of a face's corners where a pixel sees its plane; not below 0, for corners are rounded.
    void weigh(int32_t face, double column, double row, double* weights) const {
        Vec at[3];
        const Vec way = way_of(column, row);
        for (int k = 0; k < 3; ++k) {
            at[k] = corner(static_cast<size_t>(face), k);
            if (viewer_.parallel) at[k] = {at[k].x - way.x, at[k].y - way.y, 1};
        }
        const Vec along = viewer_.parallel ? Vec{0, 0, 1} : way;
        for (int k = 0; k < 3; ++k) {
            const Vec b = at[(k + 1) % 3], c = at[(k + 2) % 3];
            weights[k] = dot(cross(c - b, c + b), along);
        }
        const double turn = weights[0] + weights[1] + weights[2] < 0 ? -1 : 1;
        double sum = 0;
        for (int k = 0; k < 3; ++k) sum += weights[k] = std::max(turn * weights[k], 0.0);
        if (!(sum > 0)) weights[0] = sum = 1;
        for (int k = 0; k < 3; ++k) weights[k] /= sum;
    }

private:
    Vec corner(size_t face, int k) const {
        return corners_[static_cast<size_t>(mesh_.faces[3 * face + static_cast<size_t>(k)])];
    }

    // The place at depth 1 that the middle of a pixel sees, or the place on the camera's plane if rays are parallel.
    Vec way_of(double column, double row) const {
        return {(column + 0.5 - center_[0]) / viewer_.focal[0], (row + 0.5 - center_[1]) / viewer_.focal[1], 1};
    }

    double pixel(double place, double z, int axis) const {
        return viewer_.focal[axis] * (viewer_.parallel ? place : place / z) + center_[axis];
    }

    Corner placed(Vec p) const {
        return {static_cast<int64_t>(std::floor(kPixel * pixel(p.x, p.z, 0) + 0.5)),
                static_cast<int64_t>(std::floor(kPixel * pixel(p.y, p.z, 1) + 0.5))};
    }

    Corner spot(size_t face, int k) const {
        return spots_[static_cast<size_t>(mesh_.faces[3 * face + static_cast<size_t>(k)])];
    }

    bool is_within(Vec p) const {
        if (!viewer_.parallel && p.z < near_) return false;
        return std::fabs(pixel(p.x, p.z, 0)) < kReach && std::fabs(pixel(p.y, p.z, 1)) < kReach;
    }

    // The pixels around a triangle that lie in the crop; none where the triangle has no area.
    Pixels pixels_of(const Corner (&p)[3]) const {
        // The first pixel whose middle is not before a place, and the last one whose middle is not behind it.
        const auto first = [](int64_t place) { return (place + kPixel / 2 - 1) >> kBits; };
        const auto last = [](int64_t place) { return (place - kPixel / 2) >> kBits; };
        const int64_t area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
        if (area == 0) return {};
        return {std::max<int64_t>(first(std::min({p[0].x, p[1].x, p[2].x})), 0),
                std::min<int64_t>(last(std::max({p[0].x, p[1].x, p[2].x})), crop_.width - 1),
                std::max<int64_t>(first(std::min({p[0].y, p[1].y, p[2].y})), 0),
                std::min<int64_t>(last(std::max({p[0].y, p[1].y, p[2].y})), crop_.height - 1), area < 0};
    }

    // How far inside one of the limits a place is: 0 near the eye's plane, then left, right, top and bottom.
    double inside(Vec p, int limit) const {
        if (limit == 0) return viewer_.parallel ? 1 : p.z - near_;
        const int axis = (limit - 1) / 2;
        const double size = viewer_.parallel ? 1 : p.z;
        const double pixels = viewer_.focal[axis] * (axis == 0 ? p.x : p.y) + center_[axis] * size;
        return kReach * size + (limit % 2 ? pixels : -pixels);
    }

    // Cuts a triangle at all limits, where two faces that share an edge have the same corners; returns their number.
    int clipped(Vec* polygon) const {
        int count = 3;
        for (int limit = 0; limit < 5 && count > 0; ++limit) {
            Vec kept[kMostCorners];
            int left = 0;
            for (int k = 0; k < count; ++k) {
                const Vec a = polygon[k], b = polygon[(k + 1) % count];
                const double from = inside(a, limit), to = inside(b, limit);
                if (from >= 0) kept[left++] = a;
                if ((from >= 0) == (to >= 0)) continue;
                const bool out = from >= 0;  // always cut from the inside: the same for both faces of an edge
                const double share = out ? from / (from - to) : to / (to - from);
                kept[left++] = out ? a + share * (b - a) : b + share * (a - b);
            }
            count = left;
            std::copy(kept, kept + count, polygon);
        }
        return count;
    }

    Nearness nearness_of(const Vec* triangle) const {
        const Vec normal = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
        const double off = dot(normal, triangle[0]), whole = viewer_.parallel ? normal.z : off;
        const double x = normal.x / viewer_.focal[0], y = normal.y / viewer_.focal[1];
        const double rest = (0.5 - center_[0]) * x + (0.5 - center_[1]) * y + (viewer_.parallel ? -off : normal.z);
        Nearness found{x / whole, y / whole, rest / whole, 0, 0};
        const double largest = std::numeric_limits<double>::max();
        if (!(std::fabs(found.across) + std::fabs(found.down) + std::fabs(found.first) <= largest))
            found.across = found.down = 0, found.first = largest;  // seen edge-on: as near as its nearest corner
        return found;
    }

    Nearness limited(Nearness depth, const Vec* polygon, int count) const {
        depth.least = std::numeric_limits<double>::infinity(), depth.most = -depth.least;
        for (int k = 0; k < count; ++k) {
            const double own = viewer_.parallel ? -polygon[k].z : 1 / polygon[k].z;
            depth.least = std::min(depth.least, own), depth.most = std::max(depth.most, own);
        }
        return depth;
    }

    void fill(const Corner (&given)[3], const Pixels& part, const Nearness& depth, int32_t face, int32_t* faces,
              double* nearness) const {
        if (part.is_empty()) return;
        const auto [left, right, top, bottom, is_turned] = part;
        const Corner p[3] = {given[0], given[is_turned ? 2 : 1], given[is_turned ? 1 : 2]};
        int64_t edge[3], across[3], down[3];
        for (int k = 0; k < 3; ++k) {
            const Corner a = p[k], b = p[(k + 1) % 3];
            const int64_t x = b.x - a.x, y = b.y - a.y;
            const bool owns = y < 0 || (y == 0 && x > 0);  // a left or a top edge
            edge[k] = x * (top * kPixel + kPixel / 2 - a.y) - y * (left * kPixel + kPixel / 2 - a.x) - (owns ? 0 : 1);
            across[k] = -y * kPixel, down[k] = x * kPixel;
        }
        for (int64_t row = top; row <= bottom; ++row) {
            int64_t e0 = edge[0], e1 = edge[1], e2 = edge[2];
            for (int64_t column = left; column <= right; ++column) {
                if ((e0 | e1 | e2) >= 0) {
                    const int64_t at = row * crop_.width + column;
                    const double own = depth.at(static_cast<double>(column), static_cast<double>(row));
                    if (own > nearness[at]) nearness[at] = own, faces[at] = face;
                }
                e0 += across[0], e1 += across[1], e2 += across[2];
            }
            for (int k = 0; k < 3; ++k) edge[k] += down[k];
        }
    }

    const mr_mesh& mesh_;
    const mr_viewer& viewer_;
    const mr_crop& crop_;
    Scratch<Vec> corners_;   // in the camera's frame
    Scratch<Corner> spots_;  // in the picture
    double near_, center_[2];
};

bool all_finite(const double* values, size_t count) {
    for (size_t k = 0; k < count; ++k)
        if (!std::isfinite(values[k])) return false;
    return true;
}

bool is_drawable(const mr_mesh& mesh, const mr_viewer& viewer, const mr_crop& crop) {
    return in_range(mesh.faces, 3 * mesh.face_count, mesh.vertices) && all_finite(mesh.positions, 3 * mesh.vertices) &&
           all_finite(viewer.turn, 9) && all_finite(viewer.shift, 3) && all_finite(viewer.center, 2) &&
           all_finite(viewer.focal, 2) && viewer.focal[0] > 0 && viewer.focal[1] > 0 && crop.width >= 0 &&
           crop.height >= 0 && crop.width <= kLargest && crop.height <= kLargest;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_draw(const mr_mesh* mesh, const mr_viewer* viewer, const mr_crop* crop, int32_t* faces, double* depths) {
    if (!is_drawable(*mesh, *viewer, *crop)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        const size_t count = static_cast<size_t>(crop->width) * static_cast<size_t>(crop->height);
        const double infinity = std::numeric_limits<double>::infinity();
        std::fill(faces, faces + count, -1);
        std::fill(depths, depths + count, -infinity);
        const Raster raster(*mesh, *viewer, *crop);
        raster.draw(faces, depths);
        for (size_t at = 0; at < count; ++at) depths[at] = faces[at] < 0 ? infinity : raster.depth(depths[at]);
        return MR_OK;
    });
}

int mr_draw_weights(const mr_mesh* mesh, const mr_viewer* viewer, const mr_crop* crop, const int32_t* faces,
                    double* weights) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        const Raster raster(*mesh, *viewer, *crop);
        for (int32_t row = 0; row < crop->height; ++row)
            for (int32_t column = 0; column < crop->width; ++column, ++faces) {
                if (*faces < 0) continue;
                raster.weigh(*faces, column, row, weights);
                weights += 3;
            }
        return MR_OK;
    });
}
