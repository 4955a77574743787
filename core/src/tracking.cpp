// Block descent with momentum. Each block step (owners; rotations; centers) lowers the energy
//   spread * (K / N) * sum_s |s - c_owner(s)|^2 + rigidity * sum_i sum_j u_ij |c_j - X_i(p_j)|^2,
// X_i rigid, p the previous centers, u the neighbour weights normalised so that sum_i u_ij = 1 for each j.
// Momentum is dropped as soon as the energy rises, so the sequence of accepted energies only falls.
#include "meshreel/tracking.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "grid.h"
#include "guarded.h"
#include "rigid3.h"

namespace meshreel {
namespace {

// The owner of each sample, updated while centers move: a sample is searched again only when its owner could have
// lost it.
class Ownership {
public:
    Ownership(const double* samples, int64_t count, size_t centers)
        : samples_(samples),
          count_(static_cast<size_t>(count)),
          owner_(count_, -1),
          slack_(count_, -1),
          sums_(centers, Vec{0, 0, 0}),
          sizes_(centers, 0) {
        for (size_t s = 0; s < count_; ++s) squares_ += dot(load(samples + 3 * s), load(samples + 3 * s));
    }

    void update(const std::vector<Vec>& centers) {
        double most = 0;
        std::vector<double> moves(centers.size(), 0);
        for (size_t i = 0; i < at_.size(); ++i) {
            moves[i] = std::sqrt(dot(centers[i] - at_[i], centers[i] - at_[i]));
            most = std::max(most, moves[i]);
        }
        const double scale = spacing(centers);
        grid_.build(centers, scale);
        for (size_t s = 0; s < count_; ++s) {
            const int32_t old = owner_[s];
            if (old >= 0 && (slack_[s] -= moves[old] + most) > 0) continue;
            const Vec x = load(samples_ + 3 * s);
            Grid::Found found{-1, 0, 0};
            double reach = old >= 0 ? length(centers[old] - x) : scale;
            while ((found = grid_.nearest(x, reach, 0.3 * scale)).id < 0 || found.best > reach + 0.3 * scale)
                reach *= 2;
            slack_[s] = found.second - found.best;
            if (found.id != old) give(s, x, old, found.id);
        }
        at_ = centers;
    }

    // Sum over the samples of the squared distance to their owner.
    double energy(const std::vector<Vec>& centers) const {
        double e = squares_;
        for (size_t i = 0; i < centers.size(); ++i)
            e += sizes_[i] * dot(centers[i], centers[i]) - 2 * dot(centers[i], sums_[i]);
        return std::max(e, 0.0);
    }

    // The sample farthest from its owner, which then belongs to `center`.
    Vec take_farthest(const std::vector<Vec>& centers, int32_t center) {
        size_t far = 0;
        double most = -1;
        for (size_t s = 0; s < count_; ++s) {
            const Vec d = load(samples_ + 3 * s) - centers[owner_[s]];
            if (dot(d, d) > most) most = dot(d, d), far = s;
        }
        const Vec x = load(samples_ + 3 * far);
        give(far, x, owner_[far], center);
        return x;
    }

    const std::vector<int32_t>& owners() const { return owner_; }
    Vec sum(size_t i) const { return sums_[i]; }
    double size(size_t i) const { return sizes_[i]; }

private:
    static double length(Vec a) { return std::sqrt(dot(a, a)); }

    double spacing(const std::vector<Vec>& centers) const {
        if (!at_.empty()) return std::max(2 * std::sqrt(energy(at_) / static_cast<double>(count_)), 1e-9);
        Vec low = centers[0], high = centers[0];
        for (const Vec& c : centers) {
            low = {std::min(low.x, c.x), std::min(low.y, c.y), std::min(low.z, c.z)};
            high = {std::max(high.x, c.x), std::max(high.y, c.y), std::max(high.z, c.z)};
        }
        return std::max(0.5 * length(high - low) / std::cbrt(static_cast<double>(centers.size())), 1e-9);
    }

    void give(size_t s, Vec x, int32_t from, int32_t to) {
        if (from >= 0) sums_[from] = sums_[from] - x, sizes_[from] -= 1;
        sums_[to] = sums_[to] + x, sizes_[to] += 1;
        owner_[s] = to;
    }

    const double* samples_;
    size_t count_;
    std::vector<int32_t> owner_;
    std::vector<double> slack_;
    std::vector<Vec> sums_, at_;
    std::vector<double> sizes_;
    double squares_ = 0;
    Grid grid_;
};

// The rigid term: a rigid motion for each neighbourhood, and where the motions around a center would put it.
class Rigidity {
public:
    explicit Rigidity(const mr_relaxation& p) : neighbours_(p.neighbours), count_(static_cast<size_t>(p.center_count)) {
        const size_t pairs = static_cast<size_t>(neighbours_.offsets[count_]);
        previous_.resize(count_);
        rotations_.assign(count_, identity());
        std::vector<double> total(count_, 1);
        for (size_t i = 0; i < count_; ++i) previous_[i] = load(p.previous + 3 * i);
        for (size_t k = 0; k < pairs; ++k) total[neighbours_.indices[k]] += neighbours_.weights[k];
        self_.resize(count_);
        weights_.resize(pairs);
        for (size_t i = 0; i < count_; ++i) self_[i] = 1 / total[i];
        for (size_t k = 0; k < pairs; ++k) weights_[k] = neighbours_.weights[k] / total[neighbours_.indices[k]];
        target_.resize(count_);
    }

    // Fits the motions to `centers`; returns the energy and leaves in target() where each center would be put.
    double fit(const std::vector<Vec>& centers, int steps) {
        std::fill(target_.begin(), target_.end(), Vec{0, 0, 0});
        double energy = 0;
        for (size_t i = 0; i < count_; ++i) energy += fit_one(i, centers, steps);
        return energy;
    }

    Vec target(size_t i) const { return target_[i]; }
    const Matrix& rotation(size_t i) const { return rotations_[i]; }

private:
    double fit_one(size_t i, const std::vector<Vec>& centers, int steps) {
        const int32_t first = neighbours_.offsets[i], last = neighbours_.offsets[i + 1];
        const Vec p0 = previous_[i], c0 = centers[i];  // local origins: small numbers, exact differences
        double w = self_[i];
        Vec p{0, 0, 0}, c{0, 0, 0};
        Matrix s{};
        for (int32_t k = first; k < last; ++k) {
            const int32_t j = neighbours_.indices[k];
            const Vec a = previous_[j] - p0, b = weights_[k] * (centers[j] - c0);
            w += weights_[k];
            p = p + weights_[k] * a;
            c = c + b;
            add_outer(s, b, a);
        }
        const Vec mean_p = (1 / w) * p, mean_c = (1 / w) * c;
        add_outer(s, -1 * c, mean_p);
        follow(rotations_[i], s, steps);
        const Matrix& r = rotations_[i];
        const Vec shift = c0 + mean_c - r * mean_p;
        double energy = place(i, self_[i], shift, centers);
        for (int32_t k = first; k < last; ++k) {
            const int32_t j = neighbours_.indices[k];
            energy += place(j, weights_[k], r * (previous_[j] - p0) + shift, centers);
        }
        return energy;
    }

    double place(size_t j, double weight, Vec where, const std::vector<Vec>& centers) {
        target_[j] = target_[j] + weight * where;
        return weight * dot(where - centers[j], where - centers[j]);
    }

    mr_neighbours neighbours_;
    size_t count_;
    std::vector<Vec> previous_, target_;
    std::vector<Matrix> rotations_;
    std::vector<double> self_, weights_;
};

bool in_range(double x) { return std::fabs(x) <= 1e100; }  // so are squares: among infinite distances no search ends
bool sound(const mr_relaxation& p, const mr_relaxed& r) {
    if (!p.samples || !r.centers || !r.owners || p.sample_count < 1 || p.center_count < 1) return false;
    if (!(p.spread > 0) || !(p.rigidity >= 0) || p.max_rounds < 1) return false;
    for (int64_t s = 0; s < 3 * p.sample_count; ++s)
        if (!in_range(p.samples[s])) return false;
    for (int64_t i = 0; i < 3 * p.center_count; ++i)
        if (!in_range(r.centers[i]) || (p.previous && !in_range(p.previous[i]))) return false;
    if (!p.previous) return true;
    const mr_neighbours& n = p.neighbours;
    if (!r.rotations || !n.offsets || n.offsets[0] != 0) return false;
    for (int64_t i = 0; i < p.center_count; ++i)
        if (n.offsets[i + 1] < n.offsets[i]) return false;
    for (int32_t k = 0; k < n.offsets[p.center_count]; ++k)
        if (n.indices[k] < 0 || n.indices[k] >= p.center_count || !(n.weights[k] > 0)) return false;
    return true;
}

// One block step from `y` (owners, motions, centers). Returns the energy at y; `gain` is what the step is sure to win.
double block_step(const mr_relaxation& p, const std::vector<Vec>& y, Ownership& owned, Rigidity* rigid,
                  std::vector<Vec>& x, double& gain) {
    owned.update(y);
    const double share = p.spread * static_cast<double>(p.center_count) / static_cast<double>(p.sample_count);
    double energy = share * owned.energy(y);
    if (rigid) energy += p.rigidity * rigid->fit(y, 2);
    gain = 0;
    for (size_t i = 0; i < y.size(); ++i) {
        double weight = share * owned.size(i);
        Vec pull = share * owned.sum(i);
        if (rigid) weight += p.rigidity, pull = pull + p.rigidity * rigid->target(i);
        x[i] = weight > 0 ? (1 / weight) * pull : owned.take_farthest(y, static_cast<int32_t>(i));
        gain += weight * dot(x[i] - y[i], x[i] - y[i]);
    }
    return energy;
}

void relax(const mr_relaxation& p, mr_relaxed& out) {
    const size_t count = static_cast<size_t>(p.center_count);
    std::vector<Vec> x(count), y(count), next(count);
    for (size_t i = 0; i < count; ++i) x[i] = y[i] = load(out.centers + 3 * i);
    Ownership owned(p.samples, p.sample_count, count);
    std::vector<Rigidity> rigid;
    if (p.previous) rigid.emplace_back(p);
    Rigidity* held = p.previous ? &rigid[0] : nullptr;
    double best = 1e300, age = 1;
    bool pushed = false;
    for (out.rounds = 1; out.rounds <= p.max_rounds; ++out.rounds) {
        double gain = 0;
        const double energy = block_step(p, y, owned, held, next, gain);
        if (pushed && energy > best) {  // momentum overshot: fall back to the last plain step, which cannot be worse
            y = x, age = 1, pushed = false;
            continue;
        }
        best = out.energy = energy;
        const double aged = 0.5 * (1 + std::sqrt(1 + 4 * age * age)), push = (age - 1) / aged;
        for (size_t i = 0; i < count; ++i) y[i] = next[i] + push * (next[i] - x[i]);
        x = next, age = aged, pushed = push > 0;
        if (gain <= p.tolerance * energy) break;
    }
    out.rounds = std::min(out.rounds, p.max_rounds);
    owned.update(x);
    if (held) held->fit(x, 20);
    for (size_t i = 0; i < count; ++i) {
        store(out.centers + 3 * i, x[i]);
        for (int k = 0; held && k < 3; ++k) store(out.rotations + 9 * i + 3 * k, held->rotation(i).row[k]);
    }
    std::copy(owned.owners().begin(), owned.owners().end(), out.owners);
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

extern "C" int mr_relax_centers(const mr_relaxation* problem, mr_relaxed* result) {
    if (!problem || !result || !sound(*problem, *result)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        relax(*problem, *result);
        return int{MR_OK};
    });
}

extern "C" int mr_motion_differences(int64_t center_count, const mr_neighbours* neighbours, const double* rotations,
                                     const double* shifts, const double* means, const double* covariances,
                                     double* out) {
    if (center_count < 1 || !neighbours || !rotations || !shifts || !means || !covariances || !out) return MR_BAD_INPUT;
    for (int64_t i = 0; i < center_count; ++i) {
        const Vec mean = load(means + 3 * i);
        const Matrix cov{{load(covariances + 9 * i), load(covariances + 9 * i + 3), load(covariances + 9 * i + 6)}};
        for (int32_t k = neighbours->offsets[i]; k < neighbours->offsets[i + 1]; ++k) {
            const int64_t j = neighbours->indices[k];
            if (j < 0 || j >= center_count) return MR_BAD_INPUT;
            Vec at = load(shifts + 3 * i) - load(shifts + 3 * j);
            double spread = 0;
            for (int r = 0; r < 3; ++r) {
                const Vec d = load(rotations + 9 * i + 3 * r) - load(rotations + 9 * j + 3 * r);
                (r == 0 ? at.x : r == 1 ? at.y : at.z) += dot(d, mean);
                spread += dot(d, cov * d);
            }
            out[k] = dot(at, at) + spread;
        }
    }
    return MR_OK;
}
