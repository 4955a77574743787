// Fusion of depth pictures into truncated signed distances (Curless and Levoy 1996).
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "guarded.h"
#include "meshreel/voxels.h"
#include "rigid3.h"

namespace meshreel {
namespace {

constexpr double kFarthest = 1e8;     // blocks from the origin: their voxels have whole numbers of 32 bits
constexpr size_t kRemembered = 4096;  // blocks met lately, which are not noted again
constexpr size_t kApart = 4;          // rows and columns between pixels that touch blocks: single ones may fly
constexpr double kStride = 0.25;      // of a block, along a ray
constexpr size_t kSide = MR_BLOCK_SIDE;

using Block = std::array<int32_t, 3>;

Vec row_of(const double* matrix, size_t columns, size_t row) { return load(matrix + columns * row); }

class Touched {
public:
    Touched(const mr_depth& picture, double voxel, double reach)
        : eye_(load(picture.eye)), block_(kSide * voxel), reach_(reach), seen_(kRemembered, Block{INT32_MIN, 0, 0}) {
        const Vec right{picture.ways[0], picture.ways[3], picture.ways[6]};
        const Vec down{picture.ways[1], picture.ways[4], picture.ways[7]};
        const Vec ahead{picture.ways[2], picture.ways[5], picture.ways[8]};
        for (size_t r = 0; r < picture.rows; r += kApart)
            for (size_t c = 0; c < picture.columns; c += kApart) {
                const double depth = picture.depths[r * picture.columns + c];
                if (!(depth > 0.0)) continue;
                const double x = static_cast<double>(c) + 0.5, y = static_cast<double>(r) + 0.5;
                add(x * right + y * down + ahead, depth);
            }
        std::sort(found.begin(), found.end());
        found.erase(std::unique(found.begin(), found.end()), found.end());
    }

    std::vector<Block> found;

private:
    void add(Vec way, double depth) {
        const double from = std::max(depth - reach_, 0.0), length = depth + reach_ - from;
        const int steps = 1 + static_cast<int>(std::sqrt(dot(way, way)) * length / (kStride * block_));
        for (int k = 0; k <= steps; ++k) note((1.0 / block_) * (eye_ + (from + length * k / steps) * way));
    }

    void note(Vec p) {
        if (!(std::fabs(p.x) < kFarthest && std::fabs(p.y) < kFarthest && std::fabs(p.z) < kFarthest)) return;
        const Block block{static_cast<int32_t>(std::floor(p.x)), static_cast<int32_t>(std::floor(p.y)),
                          static_cast<int32_t>(std::floor(p.z))};
        const uint32_t hash = static_cast<uint32_t>(block[0]) * 73856093u ^
                              static_cast<uint32_t>(block[1]) * 19349663u ^ static_cast<uint32_t>(block[2]) * 83492791u;
        Block& lately = seen_[hash % kRemembered];
        if (lately == block) return;
        lately = block;
        found.push_back(block);
    }

    Vec eye_;
    double block_, reach_;
    std::vector<Block> seen_;
};

class Integration {
public:
    Integration(const mr_depth& picture, double reach, const mr_blocks& into) : picture_(picture), into_(into) {
        reach_ = static_cast<float>(reach), columns_ = static_cast<float>(picture.columns);
        rows_ = static_cast<float>(picture.rows);
        for (size_t r = 0; r < 3; ++r)
            for (size_t d = 0; d < 3; ++d)
                steps_[r][d] = static_cast<float>(into.voxel * picture.projection[4 * r + d]);
    }

    void add(size_t number) {
        const int32_t* block = into_.blocks + 3 * number;
        const Vec corner = (kSide * into_.voxel) * Vec{double(block[0]), double(block[1]), double(block[2])};
        float first[3];
        for (size_t r = 0; r < 3; ++r)
            first[r] =
                static_cast<float>(dot(row_of(picture_.projection, 4, r), corner) + picture_.projection[4 * r + 3]);
        float* distances = into_.distances + MR_BLOCK_VOXELS * number;
        float* weights = into_.weights + MR_BLOCK_VOXELS * number;
        for (size_t line = 0; line < kSide * kSide; ++line, distances += kSide, weights += kSide) {
            float start[3];
            for (size_t r = 0; r < 3; ++r)
                start[r] = first[r] + static_cast<float>(line % kSide) * steps_[r][1] +
                           static_cast<float>(line / kSide) * steps_[r][2];
            add(start, distances, weights);
        }
    }

private:
    // A line of voxels along x, which begins at `start` in homogeneous coordinates of pixels.
    void add(const float* start, float* distances, float* weights) const {
        float ahead[kSide], column[kSide], row[kSide];
        for (size_t i = 0; i < kSide; ++i) {
            const float along = static_cast<float>(i);
            ahead[i] = start[2] + along * steps_[2][0];
            column[i] = (start[0] + along * steps_[0][0]) / ahead[i];
            row[i] = (start[1] + along * steps_[1][0]) / ahead[i];
        }
        for (size_t i = 0; i < kSide; ++i) {
            const bool within = column[i] >= 0.0f && column[i] < columns_ && row[i] >= 0.0f && row[i] < rows_;
            if (!(ahead[i] > 0.0f) || !within) continue;
            const size_t pixel = static_cast<size_t>(row[i]) * picture_.columns + static_cast<size_t>(column[i]);
            const float depth = picture_.depths[pixel], behind = depth - ahead[i];
            if (!(depth > 0.0f) || behind < -reach_) continue;
            const float distance = std::min(behind / reach_, 1.0f);
            distances[i] = (weights[i] * distances[i] + distance) / (weights[i] + 1.0f);
            weights[i] += 1.0f;
        }
    }

    const mr_depth& picture_;
    const mr_blocks& into_;
    float reach_, columns_, rows_;
    float steps_[3][3];  // of homogeneous coordinates of pixels, from voxel to voxel along each axis
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

struct mr_touched {
    Touched touched;
};

int mr_touched_create(const mr_depth* picture, double voxel, double reach, mr_touched** out, const int32_t** blocks,
                      size_t* count) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (!(voxel > 0.0) || !(reach > 0.0)) return MR_BAD_INPUT;
        *out = new mr_touched{Touched(*picture, voxel, reach)};
        *blocks = (*out)->touched.found.empty() ? nullptr : (*out)->touched.found[0].data();
        *count = (*out)->touched.found.size();
        return MR_OK;
    });
}

void mr_touched_destroy(mr_touched* touched) { delete touched; }

int mr_integrate(const mr_depth* picture, double reach, const mr_blocks* into) {
    Integration integration(*picture, reach, *into);
    for (size_t n = 0; n < into->count; ++n) integration.add(n);
    return MR_OK;
}
