// Closed-loop quantisation of all columns together, in a metric that sees errors across a surface better than along it.
#include <algorithm>
#include <cmath>
#include <vector>

#include "guarded.h"
#include "meshreel/layers.h"
#include "prediction.h"

namespace meshreel {
namespace {

constexpr int kSweeps = 3;  // over the columns of a vertex; more sweeps change nothing

double dot(const double* a, const double* b, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; ++i) sum += a[i] * b[i];
    return sum;
}

class SurfaceQuantizer {
public:
    SurfaceQuantizer(const mr_graph& graph, const mr_surface& surface, double step, double price)
        : graph_(graph),
          surface_(surface),
          step_(step),
          price_(price),
          width_(surface.width),
          seen_(surface.columns * width_),
          error_(width_),
          guesses_(surface.columns),
          slopes_(surface.columns),
          wanted_(surface.columns),
          sizes_(surface.columns) {}

    // Symbols, with those that were there as the expected magnitudes.
    bool run(const double* values, int32_t* symbols, double* decoded) {
        const size_t count = graph_.count, columns = surface_.columns;
        std::vector<double> means(columns, 0.0);
        for (size_t k = 0; k < columns; ++k)
            for (size_t v = 0; v < count; ++v)
                means[k] += std::fabs(static_cast<double>(symbols[k * count + v])) / static_cast<double>(count);
        for (size_t v = 0; v < count; ++v) {
            for (size_t k = 0; k < columns; ++k) {
                guesses_[k] = predicted(graph_, v, decoded + k * count);
                slopes_[k] = slope(magnitude_around(graph_, v, symbols + k * count, means[k]));
                wanted_[k] = (values[k * count + v] - guesses_[k]) / step_;
                if (!(std::fabs(wanted_[k]) < 2147483000.0)) return false;
            }
            choose(v);
            for (size_t k = 0; k < columns; ++k) {
                symbols[k * count + v] = static_cast<int32_t>(sizes_[k]);
                decoded[k * count + v] = guesses_[k] + step_ * static_cast<double>(symbols[k * count + v]);
            }
        }
        return true;
    }

private:
    // The vectors as the metric at v sees them: what lies along the surface counts `tangential` times.
    void look_from(size_t v) {
        const double* normals = surface_.normals + v * width_;
        const double along = surface_.tangential;
        for (size_t k = 0; k < surface_.columns; ++k) {
            const double* x = surface_.vectors + k * width_;
            double* y = seen_.data() + k * width_;
            for (size_t c = 0; c < width_; c += 3) {
                const double across = (1.0 - along) * dot(normals + c, x + c, 3);
                for (size_t i = c; i < c + 3; ++i) y[i] = along * x[i] + across * normals[i];
            }
        }
    }

    // Coordinate descent from the nearest symbols, each weighed against its price.
    void choose(size_t v) {
        look_from(v);
        std::fill(error_.begin(), error_.end(), 0.0);
        for (size_t k = 0; k < surface_.columns; ++k) move(k, 0.0, sizes_[k] = std::round(wanted_[k]));
        for (int sweep = 0; sweep < kSweeps; ++sweep) {
            for (size_t k = 0; k < surface_.columns; ++k) {
                const double* seen = seen_.data() + k * width_;
                const double weight = dot(seen, surface_.vectors + k * width_, width_);
                if (!(weight > 0.0)) continue;
                const double best = sizes_[k] - dot(seen, error_.data(), width_) / weight;
                const double size = lowered(std::fabs(best), price_ * slopes_[k] / weight);
                const double symbol = std::fabs(best) < 2147483000.0 ? std::copysign(size, best) : sizes_[k];
                move(k, sizes_[k] - wanted_[k], symbol);
                sizes_[k] = symbol;
            }
        }
    }

    void move(size_t k, double before, double symbol) {
        const double change = symbol - wanted_[k] - before;
        const double* x = surface_.vectors + k * width_;
        for (size_t c = 0; c < width_; ++c) error_[c] += change * x[c];
    }

    const mr_graph& graph_;
    const mr_surface& surface_;
    double step_, price_;
    size_t width_;
    std::vector<double> seen_, error_, guesses_, slopes_, wanted_, sizes_;
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_predict_surface(const mr_graph* graph, const mr_surface* surface, const double* values, double step,
                       double price, int32_t* symbols, double* decoded) {
    const int status = mr_predict_forward(graph, values, surface->columns, step, price, symbols, decoded);
    if (status != MR_OK) return status;
    return guarded(MR_NO_MEMORY, [&] {
        SurfaceQuantizer quantizer(*graph, *surface, step, price);
        return quantizer.run(values, symbols, decoded) ? int{MR_OK} : int{MR_OVERFLOW};
    });
}
