// Points in a uniform grid, for searches of the nearest one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rigid3.h"

namespace meshreel {

// Centers in a uniform grid: the nearest one within a ball, exactly.
class Grid {
public:
    void build(const std::vector<Vec>& points, double cell) {
        low_ = high_ = points[0];
        for (const Vec& p : points) {
            low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
            high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y), std::max(high_.z, p.z)};
        }
        const Vec size = high_ - low_;
        const double room = 32.0 * static_cast<double>(points.size()) + 64;
        cell = std::max(cell, 1e-12 + 1e-3 * std::max(size.x, std::max(size.y, size.z)));
        while ((size.x / cell + 1) * (size.y / cell + 1) * (size.z / cell + 1) > room) cell *= 1.25;
        inverse_ = 1 / cell;
        n_[0] = static_cast<int>(size.x * inverse_) + 1;
        n_[1] = static_cast<int>(size.y * inverse_) + 1;
        n_[2] = static_cast<int>(size.z * inverse_) + 1;
        start_.assign(static_cast<size_t>(n_[0]) * n_[1] * n_[2] + 1, 0);
        std::vector<size_t> where(points.size());
        for (size_t i = 0; i < points.size(); ++i) {
            where[i] =
                (static_cast<size_t>(at(points[i].x - low_.x, 0)) * n_[1] + at(points[i].y - low_.y, 1)) * n_[2] +
                at(points[i].z - low_.z, 2);
            ++start_[where[i] + 1];
        }
        for (size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
        std::vector<int32_t> next(start_.begin(), start_.end() - 1);
        ids_.resize(points.size());
        sorted_.resize(points.size());
        for (size_t i = 0; i < points.size(); ++i) {
            const int32_t slot = next[where[i]]++;
            ids_[slot] = static_cast<int32_t>(i);
            sorted_[slot] = points[i];
        }
    }

    struct Found {
        int32_t id;
        double best, second;  // distances; second is a lower bound to all others
    };

    // The nearest center to x, known to be no farther than `reach`; others are looked for up to `margin` farther.
    Found nearest(Vec x, double reach, double margin) const {
        const double r = reach + margin;
        const Vec a = x - low_;
        const int x0 = at(a.x - r, 0), x1 = at(a.x + r, 0), y0 = at(a.y - r, 1), y1 = at(a.y + r, 1);
        const int z0 = at(a.z - r, 2), z1 = at(a.z + r, 2);
        double best = 1e300, second = r * r;
        int32_t id = -1;
        for (int i = x0; i <= x1; ++i)
            for (int j = y0; j <= y1; ++j) {
                const size_t line = (static_cast<size_t>(i) * n_[1] + j) * n_[2];
                for (int32_t k = start_[line + z0]; k < start_[line + z1 + 1]; ++k) {
                    const Vec d = sorted_[k] - x;
                    const double q = dot(d, d);
                    if (q < best || (q == best && ids_[k] < id)) {
                        second = std::min(second, best);
                        best = q;
                        id = ids_[k];
                    } else if (q < second) {
                        second = q;
                    }
                }
            }
        return {id, std::sqrt(best), std::sqrt(second)};
    }

private:
    int at(double offset, int axis) const {
        const double cell = offset * inverse_;
        if (!(cell > 0)) return 0;
        return cell >= n_[axis] ? n_[axis] - 1 : static_cast<int>(cell);
    }

    Vec low_{}, high_{};
    double inverse_ = 1;
    int n_[3] = {1, 1, 1};
    std::vector<int32_t> start_, ids_;
    std::vector<Vec> sorted_;
};

}  // namespace meshreel
