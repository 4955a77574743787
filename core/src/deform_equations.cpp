#include "deform_equations.h"

#include "meshreel/dense.h"

namespace meshreel {
namespace {

constexpr size_t kUnknowns = 6;

Lanes weighted(const float* columns, const float* x, size_t half) {  // six columns of eight rows: four of the rows
    Lanes sum = lanes(0.0f);
    for (size_t k = 0; k < kUnknowns; ++k) sum = sum + load_lanes(columns + kTwist * k + 4 * half) * lanes(x[k]);
    return sum;
}

double product(const std::vector<float>& a, const std::vector<float>& b) {
    double sums[kTwist] = {};
    for (size_t k = 0; k < a.size(); k += kTwist)
        for (size_t d = 0; d < kTwist; ++d) sums[d] += static_cast<double>(a[k + d]) * static_cast<double>(b[k + d]);
    double sum = 0.0;
    for (size_t d = 0; d < kUnknowns; ++d) sum += sums[d];
    return sum;
}

float sum_of(Lanes a) {
    float all[4];
    store_lanes(all, a);
    return (all[0] + all[1]) + (all[2] + all[3]);
}

}  // namespace

void TwistEquations::add_prior(size_t node, double turn, double step) {
    prior_.resize(kTwist * nodes_, 0.0f);
    for (size_t d = 0; d < kUnknowns; ++d) {
        const double weight = d < 3 ? turn : step;
        prior_[kTwist * node + d] += static_cast<float>(weight);
        blocks_[node][7 * d] += weight;
    }
}

void TwistEquations::add(int32_t node, Vec turn, Vec step) {
    const double row[kUnknowns] = {turn.x, turn.y, turn.z, step.x, step.y, step.z};
    const size_t n = static_cast<size_t>(node);
    for (size_t i = 0; i < kUnknowns; ++i) {
        right_[n][i] += row[i] * misses_.back();
        for (size_t j = 0; j < kUnknowns; ++j) blocks_[n][kUnknowns * i + j] += row[i] * row[j];
        values_.push_back(static_cast<float>(row[i]));
    }
    values_.insert(values_.end(), kTwist - kUnknowns, 0.0f);
    columns_.push_back(node);
}

void TwistEquations::invert() {
    std::vector<double> inverses(36 * nodes_);
    mr_inverses(blocks_[0].data(), nodes_, kUnknowns, inverses.data());
    inverses_.assign(kUnknowns * kTwist * nodes_, 0.0f);
    for (size_t n = 0; n < nodes_; ++n)
        for (size_t column = 0; column < kUnknowns; ++column)
            for (size_t row = 0; row < kUnknowns; ++row)
                inverses_[(kUnknowns * n + column) * kTwist + row] =
                    static_cast<float>(inverses[36 * n + kUnknowns * row + column]);
}

void TwistEquations::multiply(const Numbers& x, Numbers& out) const {
    for (size_t k = 0; k < x.size(); ++k) out[k] = prior_[k] * x[k];
    for (size_t row = 0; row < starts_.size(); ++row) {
        const size_t end = row + 1 < starts_.size() ? starts_[row + 1] : columns_.size();
        Lanes sum = lanes(0.0f);
        for (size_t k = starts_[row]; k < end; ++k) {
            const float *value = &values_[kTwist * k], *of = &x[kTwist * static_cast<size_t>(columns_[k])];
            sum = sum + load_lanes(value) * load_lanes(of) + load_lanes(value + 4) * load_lanes(of + 4);
        }
        const Lanes all = lanes(sum_of(sum));
        for (size_t k = starts_[row]; k < end; ++k) {
            const float* value = &values_[kTwist * k];
            float* to = &out[kTwist * static_cast<size_t>(columns_[k])];
            store_lanes(to, load_lanes(to) + all * load_lanes(value));
            store_lanes(to + 4, load_lanes(to + 4) + all * load_lanes(value + 4));
        }
    }
}

void TwistEquations::solve(int iterations, double tolerance, Numbers& x) {
    const size_t size = kTwist * nodes_;
    invert();
    x.assign(size, 0.0f);
    Numbers r(size, 0.0f), z(size), p(size), product_of(size);
    for (size_t n = 0; n < nodes_; ++n)
        for (size_t d = 0; d < kUnknowns; ++d) r[kTwist * n + d] = static_cast<float>(right_[n][d]);
    const auto conditioned = [&] {
        for (size_t n = 0; n < nodes_; ++n)
            for (size_t half = 0; half < 2; ++half)
                store_lanes(&z[kTwist * n + 4 * half],
                            weighted(&inverses_[kUnknowns * kTwist * n], &r[kTwist * n], half));
        return product(r, z);
    };
    double rz = conditioned();
    p = z;
    const double enough = tolerance * tolerance * rz;
    for (int k = 0; k < iterations && rz > enough; ++k) {
        multiply(p, product_of);
        const float step = static_cast<float>(rz / product(p, product_of));
        for (size_t i = 0; i < size; ++i) x[i] += step * p[i], r[i] -= step * product_of[i];
        const double before = rz;
        rz = conditioned();
        const float more = static_cast<float>(rz / before);
        for (size_t i = 0; i < size; ++i) p[i] = z[i] + more * p[i];
    }
}

}  // namespace meshreel
