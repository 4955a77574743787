// What surrounds a weight on the mesh and in earlier columns, as contexts for its magnitude and a prediction of its
// sign.
//
// Integers only, in a fixed order: encoder and decoder, on every platform, see the same contexts.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "magnitude_classes.h"
#include "meshreel/entropy.h"

namespace meshreel {

constexpr int kSigns = 48;       // predicted sign x how strongly predicted x magnitude (1, 2, more)
constexpr size_t kNearest = 32;  // neighbours that count, the last in order (guess)
constexpr size_t kHistory = 6;   // earlier columns that predict (guess)
constexpr size_t kTaps = kHistory + 2;

constexpr ClassTable<1> kClassOf;

constexpr std::array<uint32_t, kNearest + 1> sixteenths() {
    std::array<uint32_t, kNearest + 1> table{};
    for (uint32_t n = 1; n <= kNearest; ++n) table[n] = (16u << 16) / n;
    return table;
}
constexpr auto kSixteenths = sixteenths();

inline int clamped(int32_t value) { return value > kClamp ? kClamp : value < -kClamp ? -kClamp : value; }
inline uint32_t magnitude(int value) { return static_cast<uint32_t>(value < 0 ? -value : value); }

// The sign is coded after the magnitude, against a predicted value in units of 2^-20: 2 x 8 x 3 contexts.
inline int sign_context(int64_t predicted, uint64_t size) {
    const int64_t strength = (predicted < 0 ? -predicted : predicted) >> 17;  // eighths
    const int level = strength > 7 ? 7 : static_cast<int>(strength);
    return ((predicted < 0) * 8 + level) * 3 + (size > 2 ? 2 : static_cast<int>(size) - 1);
}

// Predicts a value, sign and all, from those around it by normalised least mean squares, in integers.
class Predictor {
public:
    void restart() { weights_.fill(0); }

    // `taps` in sixteenths, the first `used` of them; the prediction in units of 2^-20.
    int64_t predict(const std::array<int32_t, kTaps>& taps, size_t used) {
        int64_t sum = 0;
        int64_t energy = 256;
        for (size_t k = 0; k < used; ++k) {
            sum += weights_[k] * taps[k];
            energy += static_cast<int64_t>(taps[k]) * taps[k];
        }
        energy_ = energy;
        return sum;
    }

    void learn(const std::array<int32_t, kTaps>& taps, size_t used, int64_t error) {
        if (energy_ == 256 || error == 0) return;
        const int64_t gain = error * 256 / energy_;
        for (size_t k = 0; k < used; ++k) {
            const int64_t moved = weights_[k] + gain * taps[k] / kCaution;
            weights_[k] = moved > kLimit ? kLimit : moved < -kLimit ? -kLimit : moved;
        }
    }

private:
    static constexpr int64_t kCaution = 2560;   // 256 / 2560: a tenth of the error is learned at once
    static constexpr int64_t kLimit = 1 << 18;  // 4, in units of 2^-16

    std::array<int64_t, kTaps> weights_{};
    int64_t energy_ = 256;
};

// What has been coded, as the contexts of what comes next. Columns before the current one are known at every vertex,
// the current one at smaller indices.
class Surroundings {
public:
    explicit Surroundings(const mr_weights& weights)
        : weights_(weights),
          current_(weights.count),
          past_(weights.count),
          history_(weights.count * kHistory),
          sums_(weights.count),
          degrees_(weights.count) {
        for (size_t v = 0; v < weights.count; ++v) {
            for (int64_t k = weights.starts[v]; k < weights.starts[v + 1]; ++k) {
                ++degrees_[v];
                ++degrees_[static_cast<size_t>(weights.neighbours[k])];
            }
        }
    }

    struct Context {
        int size;           // class of expected magnitude
        int64_t predicted;  // units of 2^-20
    };

    Context at(size_t v) {
        size_t begin = static_cast<size_t>(weights_.starts[v]);
        const size_t end = static_cast<size_t>(weights_.starts[v + 1]);
        if (end - begin > kNearest) begin = end - kNearest;
        uint32_t sum = 0;
        int32_t total = 0;
        for (size_t k = begin; k < end; ++k) {
            const int near = current_[static_cast<size_t>(weights_.neighbours[k])];
            sum += magnitude(near);
            total += near;
        }
        const int last = v > 0 ? current_[v - 1] : 0;
        uint32_t expected;  // sixteenths
        if (end > begin) {
            expected = sum * kSixteenths[end - begin] >> 16;
            taps_[0] = total * 16 / static_cast<int32_t>(end - begin);
        } else {  // a vertex of the mesh before its subdivision: those coded just before lie near
            expected = 8 * (magnitude(last) + (v > 1 ? magnitude(current_[v - 2]) : 0));
            taps_[0] = 16 * last;
        }
        if (column_ > 0) expected = (2 * expected + 3 * scaled(past_[v])) / 5;
        taps_[1] = 16 * last;
        for (size_t k = 0; k + 2 < used_; ++k) taps_[k + 2] = 16 * history_[v * kHistory + k];
        predicted_ = predictor_.predict(taps_, used_);
        const uint64_t strength = static_cast<uint64_t>(predicted_ < 0 ? -predicted_ : predicted_) >> 16;
        const uint64_t size = expected + strength;  // where much is predicted, much comes
        return {kClassOf[size], predicted_};
    }

    // The value at the vertex that at() was last asked for.
    void learn(size_t v, int32_t value) {
        current_[v] = static_cast<int16_t>(clamped(value));
        predictor_.learn(taps_, used_, current_[v] * (int64_t{1} << 20) - predicted_);
        seen_ += 16 * magnitude(current_[v]);
        expected_ += past_[v];
        if (++age_ == 64) rescale();
    }

    // Ends a column: it joins the past, in which each step back weighs 45 / 64.
    void next_column() {
        for (size_t v = 0; v < weights_.count; ++v) {
            for (int64_t k = weights_.starts[v]; k < weights_.starts[v + 1]; ++k) {
                const size_t u = static_cast<size_t>(weights_.neighbours[k]);
                sums_[v] += magnitude(current_[u]);
                sums_[u] += magnitude(current_[v]);
            }
        }
        for (size_t v = 0; v < weights_.count; ++v) {
            const uint32_t around = degrees_[v] ? 16 * sums_[v] / degrees_[v] : 0;
            past_[v] = past_[v] * 45 / 64 + 16 * (128 * magnitude(current_[v]) + around) / 9;
            sums_[v] = 0;
            int16_t* history = &history_[v * kHistory];
            for (size_t k = kHistory - 1; k > 0; --k) history[k] = history[k - 1];
            history[0] = current_[v];
        }
        ++column_;
        if (used_ < kTaps) ++used_;
        predictor_.restart();
        seen_ = expected_ = 0;
        age_ = 0;
        ratio_ = kFirstRatio;
    }

private:
    uint32_t scaled(uint32_t past) const { return static_cast<uint32_t>((static_cast<uint64_t>(past) * ratio_) >> 16); }

    // The past predicts where a column is large; the ratio to the past is learned, with a memory of 400 vertices.
    void rescale() {
        age_ = 0;
        ratio_ = ((seen_ << 16) + 1024 * kFirstRatio) / (expected_ + 1024);
        if (ratio_ > 1u << 20) ratio_ = 1u << 20;
        seen_ -= seen_ / 6;
        expected_ -= expected_ / 6;
    }

    const mr_weights& weights_;
    std::vector<int16_t> current_;
    std::vector<uint32_t> past_;
    std::vector<int16_t> history_;  // kHistory values a vertex, the column before first
    std::vector<uint32_t> sums_;
    std::vector<uint32_t> degrees_;
    Predictor predictor_;
    std::array<int32_t, kTaps> taps_{};  // sixteenths: neighbours' mean, last vertex, earlier columns
    size_t used_ = 2;
    int64_t predicted_ = 0;
    size_t column_ = 0;
    uint64_t seen_ = 0;
    uint64_t expected_ = 0;
    uint64_t ratio_ = kFirstRatio;
    uint32_t age_ = 0;
};

}  // namespace meshreel
