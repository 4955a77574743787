// Signed distances from points with normals: the mean of the distances from the planes of near points (Kolluri 2008).
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "guarded.h"
#include "meshreel/voxels.h"
#include "rigid3.h"

namespace meshreel {
namespace {

constexpr int kSide = MR_BLOCK_SIDE;
constexpr int32_t kFarthest = 100'000'000;  // blocks from the origin: their voxels have whole numbers of 32 bits

struct Block {
    int32_t x, y, z;
    bool operator<(const Block& b) const { return x != b.x ? x < b.x : y != b.y ? y < b.y : z < b.z; }
    bool operator==(const Block& b) const { return x == b.x && y == b.y && z == b.z; }
};

struct Sums {
    double weight = 0, along = 0;
    Vec away{0, 0, 0}, normal{0, 0, 0};
};

class PointDistances {
public:
    PointDistances(const mr_oriented& points, double radius, double past, const mr_blocks& into)
        : points_(points), radius_(radius), past_(past), into_(into), first_(into.count + 1, 0) {
        std::vector<size_t> block(points.count);
        for (size_t p = 0; p < points.count; ++p) {
            block[p] = find(block_of(load(points.positions + 3 * p)));
            if (block[p] < into.count) ++first_[block[p] + 1];
        }
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        own_.resize(first_.back());
        std::vector<size_t> next(first_.begin(), first_.end() - 1);
        for (size_t p = 0; p < points.count; ++p)
            if (block[p] < into.count) own_[next[block[p]]++] = p;
    }

    void add(size_t number) {
        sums_.assign(MR_BLOCK_VOXELS, Sums{});
        const Block block = at(number);
        for (int32_t x = -1; x <= 1; ++x)
            for (int32_t y = -1; y <= 1; ++y)
                for (int32_t z = -1; z <= 1; ++z) {
                    const size_t near = find({block.x + x, block.y + y, block.z + z});
                    if (near == into_.count) continue;
                    for (size_t k = first_[near]; k < first_[near + 1]; ++k) take(block, own_[k]);
                }
        float* distances = into_.distances + MR_BLOCK_VOXELS * number;
        float* weights = into_.weights + MR_BLOCK_VOXELS * number;
        for (size_t v = 0; v < MR_BLOCK_VOXELS; ++v) {
            const Sums& sum = sums_[v];
            const double length = std::sqrt(dot(sum.normal, sum.normal));
            if (!(length > 0)) continue;
            const Vec away = (1 / sum.weight) * sum.away;
            const double ahead = dot(away, sum.normal) / length;
            if (dot(away, away) - ahead * ahead > past_ * past_) continue;
            distances[v] = static_cast<float>(std::clamp(sum.along / (sum.weight * radius_), -1.0, 1.0));
            weights[v] = 1.0f;
        }
    }

private:
    Block at(size_t number) const {
        return {into_.blocks[3 * number], into_.blocks[3 * number + 1], into_.blocks[3 * number + 2]};
    }

    Block block_of(Vec p) const {
        const double side = kSide * into_.voxel;
        return {static_cast<int32_t>(std::floor(p.x / side)), static_cast<int32_t>(std::floor(p.y / side)),
                static_cast<int32_t>(std::floor(p.z / side))};
    }

    // The index of a block; the count of all where there is none.
    size_t find(Block wanted) const {
        size_t low = 0, high = into_.count;
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (at(middle) < wanted) low = middle + 1;
            else high = middle;
        }
        return low < into_.count && at(low) == wanted ? low : into_.count;
    }

    void take(Block block, size_t point) {
        const Vec p = load(points_.positions + 3 * point), normal = load(points_.normals + 3 * point);
        const double own[3] = {p.x, p.y, p.z};
        const int32_t corner[3] = {kSide * block.x, kSide * block.y, kSide * block.z};
        int from[3], to[3];
        for (int d = 0; d < 3; ++d) {
            from[d] = std::max(0, static_cast<int>(std::ceil((own[d] - radius_) / into_.voxel) - corner[d]));
            to[d] = std::min(kSide - 1, static_cast<int>(std::floor((own[d] + radius_) / into_.voxel) - corner[d]));
        }
        const double square = radius_ * radius_;
        for (int k = from[2]; k <= to[2]; ++k)
            for (int j = from[1]; j <= to[1]; ++j)
                for (int i = from[0]; i <= to[0]; ++i) {
                    const Vec away =
                        into_.voxel * Vec{double(corner[0] + i), double(corner[1] + j), double(corner[2] + k)} - p;
                    const double left = 1 - dot(away, away) / square;
                    if (!(left > 0)) continue;
                    const double weight = left * left;
                    Sums& sum = sums_[(kSide * k + j) * kSide + i];
                    sum.weight += weight;
                    sum.along += weight * dot(normal, away);
                    sum.away = sum.away + weight * away;
                    sum.normal = sum.normal + weight * normal;
                }
    }

    const mr_oriented& points_;
    double radius_, past_;
    const mr_blocks& into_;
    std::vector<size_t> first_, own_;  // points of each block, by blocks
    std::vector<Sums> sums_;           // of a block's voxels
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_point_distances(const mr_oriented* points, double radius, double past, const mr_blocks* into) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (!(radius > 0.0) || !(radius <= MR_BLOCK_SIDE * into->voxel)) return MR_BAD_INPUT;
        for (size_t n = 0; n < into->count; ++n) {
            const int32_t* b = into->blocks + 3 * n;
            for (int d = 0; d < 3; ++d)
                if (b[d] < -kFarthest || b[d] > kFarthest) return MR_BAD_INPUT;
            if (n > 0 && !(Block{b[-3], b[-2], b[-1]} < Block{b[0], b[1], b[2]})) return MR_BAD_INPUT;
        }
        const double most = 1e8 * MR_BLOCK_SIDE * into->voxel;
        for (size_t k = 0; k < 3 * points->count; ++k)
            if (!(std::fabs(points->positions[k]) < most)) return MR_BAD_INPUT;
        PointDistances distances(*points, radius, past, *into);
        for (size_t n = 0; n < into->count; ++n) distances.add(n);
        return MR_OK;
    });
}
