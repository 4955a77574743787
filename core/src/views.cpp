// Places are projected, compared with the depth that the camera saw there, and coloured by the four pixels around.
#include "meshreel/views.h"

#include <algorithm>
#include <cmath>

#include "rigid3.h"

namespace meshreel {
namespace {

struct Spot {
    double x, y;  // pixels
};

// Two neighbours along a side of a picture, and the share of the second.
struct Pair {
    size_t first, second;
    double share;
    Pair(double place, int32_t size) {
        const double at = std::min(std::max(place - 0.5, 0.0), static_cast<double>(size - 1));
        const int32_t lower = std::max(std::min(static_cast<int32_t>(at), size - 2), 0);
        first = static_cast<size_t>(lower), second = static_cast<size_t>(std::min(lower + 1, size - 1));
        share = at - lower;
    }
};

// What a picture has around a spot, `value` of row and column, blended between the middles of pixels.
template <class Value>
double blended(const Pair& x, const Pair& y, Value value) {
    const double upper = value(y.first, x.first) * (1 - x.share) + value(y.first, x.second) * x.share;
    const double lower = value(y.second, x.first) * (1 - x.share) + value(y.second, x.second) * x.share;
    return upper * (1 - y.share) + lower * y.share;
}

class View {
public:
    explicit View(const mr_view& view)
        : view_(view), turn_{{load(view.viewer.turn), load(view.viewer.turn + 3), load(view.viewer.turn + 6)}} {}

    // The weight of a place, and where it is in the picture; 0 for what is hidden or outside.
    double weight(Vec point, Vec normal, Spot& spot) const {
        const Vec to_eye = load(view_.eye) - point, local = turn_ * point + load(view_.viewer.shift);
        const double cosine = dot(normal, to_eye) / std::max(std::sqrt(dot(to_eye, to_eye)), 1e-12);
        if (!(cosine > 0) || !(local.z > 0)) return 0;
        const Spot straight = projected(local.x / local.z, local.y / local.z);
        spot = view_.bends ? bent(local.x / local.z, local.y / local.z) : straight;
        const double right = view_.width, bottom = view_.height;
        if (!(spot.x >= 0.5 && spot.y >= 0.5 && spot.x <= right - 0.5 && spot.y <= bottom - 0.5)) return 0;
        if (!(straight.x >= 0 && straight.y >= 0 && straight.x <= right && straight.y <= bottom)) return 0;
        const double x = straight.x / view_.shrink, y = straight.y / view_.shrink;
        const size_t stride = static_cast<size_t>(view_.columns);
        const size_t column = static_cast<size_t>(std::min(static_cast<int32_t>(x), view_.columns - 1));
        const size_t row = static_cast<size_t>(std::min(static_cast<int32_t>(y), view_.rows - 1));
        const double squarely = cosine * cosine * cosine;
        double near = view_.from_step[row * stride + column] / 255.0;
        if (near < 1 && squarely * near < view_.least) near = 0;
        near = std::max(near, view_.at_step);
        if (near == 0) return 0;
        // The inverse depth of a plane is linear in a picture.
        const double seen = blended(Pair(x, view_.columns), Pair(y, view_.rows), [&](size_t down, size_t across) {
            return static_cast<double>(1 / view_.depth[down * stride + across]);
        });
        const bool agrees = std::fabs(seen * local.z - 1) <= std::max(view_.margin / local.z, view_.share);
        return agrees ? squarely * near : 0;
    }

    void add_color(const Spot& spot, double weight, double* sums) const {
        const Pair x(spot.x, view_.picture_columns), y(spot.y, view_.picture_rows);
        const size_t stride = static_cast<size_t>(view_.picture_columns);
        for (size_t k = 0; k < 3; ++k) {
            const double color = blended(x, y, [&](size_t down, size_t across) {
                return static_cast<double>(view_.pixels[3 * (down * stride + across) + k]);
            });
            sums[k] += color / view_.gains[k] * weight;
        }
    }

private:
    Spot projected(double x, double y) const {
        return {view_.viewer.focal[0] * x + view_.viewer.center[0], view_.viewer.focal[1] * y + view_.viewer.center[1]};
    }

    Spot bent(double x, double y) const {
        const double (&k)[8] = view_.bend;
        const double r2 = x * x + y * y;
        const double bend = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
        return projected(x * bend + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
                         y * bend + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y);
    }

    const mr_view& view_;
    const Matrix turn_;
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_add_view(const mr_view* view, const double* points, const double* normals, size_t count, double* sums,
                double* weights) {
    if (view->rows < 1 || view->columns < 1 || view->shrink < 1 || view->width < 1 || view->height < 1 ||
        (view->pixels && (view->picture_rows < 1 || view->picture_columns < 1)))
        return MR_BAD_INPUT;
    const View seen(*view);
    for (size_t place = 0; place < count; ++place) {
        Spot spot{};
        const double weight = seen.weight(load(points + 3 * place), load(normals + 3 * place), spot);
        if (weight == 0) continue;
        weights[place] += weight;
        if (view->pixels) seen.add_color(spot, weight, sums + 3 * place);
    }
    return MR_OK;
}
