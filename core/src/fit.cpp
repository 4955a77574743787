#include "meshreel/fit.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "arrays.h"
#include "fit_equations.h"
#include "guarded.h"
#include "pair_weight.h"
#include "rounds.h"
#include "tree_handle.h"

namespace meshreel {
namespace {

struct Samples {  // on open borders
    std::vector<double> points;
    std::vector<Vec> normals, outward;
    std::vector<int32_t> faces;
    std::vector<std::array<double, 3>> corners;

    size_t count() const { return faces.size(); }
};

// A tree over points, as triangles without size.
std::unique_ptr<SurfaceTree> tree_of_points(const double* points, size_t count) {
    std::vector<int32_t> faces(3 * count);
    for (size_t k = 0; k < faces.size(); ++k) faces[k] = static_cast<int32_t>(k / 3);
    return std::make_unique<SurfaceTree>(mr_mesh{points, count, faces.data(), count});
}

class Fit {
public:
    Fit(const Template& fitted, const mr_target& target, const mr_fit_rounds& rounds, const double* rest,
        double* positions)
        : fitted_(fitted), target_(target), rounds_(rounds), x_(positions), equations_(fitted) {
        seen_.assign(target.mesh.vertices, -1);
        sees_.assign(fitted.count + fitted.faces.size(), -1);
        normals_.resize(fitted.count);
        face_normals_.resize(fitted.faces.size());
        tree_ = fitted.take_tree(rest);
    }
    ~Fit() { fitted_.give_tree(std::move(tree_)); }
    Fit(const Fit&) = delete;

    void round(double gate, double smoothing, size_t stride, double tolerance, const std::vector<Vec>& shape,
               const double* place) {
        tree_->move(x_);
        find_normals();
        equations_.clear(x_);
        from_target(gate, stride);
        from_template(gate, stride);
        from_borders(2.0 * gate);
        equations_.solve(smoothing, shape, rounds_.anchor, place, rounds_.iterations, tolerance, x_);
    }

private:
    Vec at(int32_t v) const { return load(x_ + 3 * static_cast<size_t>(v)); }

    void find_normals() {
        std::fill(normals_.begin(), normals_.end(), Vec{0, 0, 0});
        for (size_t f = 0; f < fitted_.faces.size(); ++f) {
            const auto& face = fitted_.faces[f];
            const Vec normal = cross(at(face[1]) - at(face[0]), at(face[2]) - at(face[0]));
            for (int32_t v : face) normals_[static_cast<size_t>(v)] = normals_[static_cast<size_t>(v)] + normal;
            face_normals_[f] = unit(normal);
        }
        for (Vec& normal : normals_) normal = unit(normal);
    }

    void add(int32_t face, const std::array<double, 3>& corners, Vec normal, Vec point, double weight) {
        if (weight > 0.0) equations_.add({face, corners, normal, dot(normal, point), weight});
    }

    // Pulls the template to the frame's vertices.
    void from_target(double gate, size_t stride) {
        const double evenly = static_cast<double>(stride * fitted_.count) / static_cast<double>(target_.mesh.vertices);
        for (size_t v = 0; v < target_.mesh.vertices; v += stride) {
            if (!target_.inside[v]) continue;
            const Vec point = load(target_.mesh.positions + 3 * v), normal = load(target_.normals + 3 * v);
            const Hit hit = tree_->closest(point, gate, seen_[v]);
            if (hit.face < 0) continue;
            seen_[v] = hit.face;
            Vec closest{0, 0, 0};
            double inside = 0.0;
            for (size_t k = 0; k < 3; ++k) {
                const int32_t corner = fitted_.faces[static_cast<size_t>(hit.face)][k];
                closest = closest + hit.weights[k] * at(corner);
                inside += hit.weights[k] * fitted_.inside[static_cast<size_t>(corner)];
            }
            const double agree = dot(normal, face_normals_[static_cast<size_t>(hit.face)]);
            const double weight =
                pair_weight(length(point - closest) / gate, agree, rounds_.agreement) * inside * evenly;
            add(hit.face, hit.weights, normal, point, weight);
        }
    }

    // Pulls the template's vertices, and the middles of its faces, to the frame's surface. There are two faces a
    // vertex: each counts half.
    void from_template(double gate, size_t stride) {
        const double share = static_cast<double>(stride);
        for (size_t v = 0; v < fitted_.count; v += stride) {
            if (fitted_.corners[v] < 0) continue;
            std::array<double, 3> corners{};
            corners[static_cast<size_t>(fitted_.corners[v] % 3)] = 1.0;
            towards(at(static_cast<int32_t>(v)), normals_[v], fitted_.corners[v] / 3, corners, share, gate, sees_[v]);
        }
        for (size_t f = 0; f < fitted_.faces.size(); f += stride) {
            const auto& face = fitted_.faces[f];
            const Vec middle = (1.0 / 3.0) * (at(face[0]) + at(face[1]) + at(face[2]));
            towards(middle, face_normals_[f], static_cast<int32_t>(f), {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0}, 0.5 * share,
                    gate, sees_[fitted_.count + f]);
        }
    }

    void towards(Vec point, Vec own, int32_t face, const std::array<double, 3>& corners, double share, double gate,
                 int32_t& guess) {
        const Hit hit = tree_of(target_.tree).closest(point, gate, guess);
        if (hit.face < 0) return;
        guess = hit.face;
        Vec closest{0, 0, 0}, normal{0, 0, 0};
        double inside = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            const size_t corner = static_cast<size_t>(target_.mesh.faces[3 * static_cast<size_t>(hit.face) + k]);
            closest = closest + hit.weights[k] * load(target_.mesh.positions + 3 * corner);
            normal = normal + hit.weights[k] * load(target_.normals + 3 * corner);
            inside += hit.weights[k] * target_.inside[corner];
        }
        normal = unit(normal);
        const double weight =
            pair_weight(length(point - closest) / gate, dot(normal, own), rounds_.agreement) * inside * share;
        add(face, corners, normal, closest, weight);
    }

    Samples own_samples() const {
        Samples samples;
        for (const auto& side : fitted_.sides) {
            const auto& face = fitted_.faces[static_cast<size_t>(side.face)];
            const size_t from = static_cast<size_t>(side.from), to = (from + 1) % 3;
            const Vec normal = face_normals_[static_cast<size_t>(side.face)];
            const Vec start = at(face[from]), along = at(face[to]) - start;
            const Vec outward = cross(unit(along), normal);  // faces lie to the left of their edges
            for (int k = 0; k < MR_RIM_SAMPLES; ++k) {
                const double share = (k + 0.5) / MR_RIM_SAMPLES;
                const Vec point = start + share * along;
                std::array<double, 3> corners{};
                corners[from] = 1.0 - share, corners[to] = share;
                samples.points.insert(samples.points.end(), {point.x, point.y, point.z});
                samples.normals.push_back(normal), samples.outward.push_back(outward);
                samples.faces.push_back(side.face), samples.corners.push_back(corners);
            }
        }
        return samples;
    }

    // Pulls the template's open borders to the frame's: point-to-plane rows leave the position across a border free.
    void from_borders(double gate) {
        const mr_rim& rim = target_.rim;
        if (fitted_.sides.empty() || rim.count == 0) return;
        const Samples own = own_samples();
        if (own_rim_) own_rim_->move(own.points.data());
        else own_rim_ = tree_of_points(own.points.data(), own.count());
        if (!rim_) rim_ = tree_of_points(rim.points, rim.count);
        for (size_t k = 0; k < own.count(); ++k) {
            const Hit hit = rim_->closest(load(&own.points[3 * k]), gate, -1);
            if (hit.face >= 0) pair_borders(own, k, static_cast<size_t>(hit.face), gate, 1.0);
        }
        const double evenly = static_cast<double>(own.count()) / static_cast<double>(rim.count);
        for (size_t k = 0; k < rim.count; ++k) {
            const Hit hit = own_rim_->closest(load(rim.points + 3 * k), gate, -1);
            if (hit.face >= 0) pair_borders(own, static_cast<size_t>(hit.face), k, gate, evenly);
        }
    }

    void pair_borders(const Samples& own, size_t mine, size_t other, double gate, double share) {
        const Vec point = load(target_.rim.points + 3 * other), normal = load(target_.rim.normals + 3 * other);
        const Vec outward = load(target_.rim.outward + 3 * other);
        if (!(dot(own.outward[mine], outward) > rounds_.agreement)) return;
        const double agree = dot(own.normals[mine], normal);
        const double away = length(load(&own.points[3 * mine]) - point) / gate;
        const double weight = pair_weight(away, agree, rounds_.agreement);
        for (Vec direction : {outward, normal})
            add(own.faces[mine], own.corners[mine], direction, point, weight * share / MR_RIM_SAMPLES);
    }

    const Template& fitted_;
    const mr_target& target_;
    const mr_fit_rounds& rounds_;
    double* x_;
    Equations equations_;
    std::vector<int32_t> seen_, sees_;  // closest faces so far: of the template, and of the frame
    std::vector<Vec> normals_, face_normals_;
    std::unique_ptr<SurfaceTree> tree_, own_rim_, rim_;  // of the template, its border, and the frame's border
};

bool is_valid(const Template& fitted, const mr_target& target, const mr_fit_rounds& rounds) {
    for (size_t k = 0; k < rounds.count; ++k)
        if (!(rounds.gates[k] > 0.0) || rounds.strides[k] < 1) return false;
    return !fitted.faces.empty() && target.mesh.vertices > 0 &&
           tree_of(target.tree).face_count() == target.mesh.face_count &&
           in_range(target.mesh.faces, 3 * target.mesh.face_count, target.mesh.vertices);
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

struct mr_template {
    mr_template(const int32_t* faces, size_t face_count, size_t vertices) : fitted(faces, face_count, vertices) {}
    Template fitted;
};

int mr_template_create(const int32_t* faces, size_t face_count, size_t vertices, mr_template** out) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (face_count > INT32_MAX / 3 || vertices > INT32_MAX || !in_range(faces, 3 * face_count, vertices))
            return MR_BAD_INPUT;
        *out = new mr_template(faces, face_count, vertices);
        return MR_OK;
    });
}

void mr_template_destroy(mr_template* fitted) { delete fitted; }

int mr_fit(mr_template* fitted, const mr_target* target, const mr_fit_rounds* rounds, const double* rest,
           const double* place, double* positions) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        const Template& f = fitted->fitted;
        if (!is_valid(f, *target, *rounds)) return MR_BAD_INPUT;
        Fit fit(f, *target, *rounds, rest, positions);
        std::vector<Matrix> turns;
        std::vector<Vec> kept, shape;
        laplacian(f, rest, kept);
        shape = kept;
        for (size_t k = 0; k < rounds->count; ++k) {
            if (rounds->turn) {
                neighbourhood_turns(f, rest, positions, turns);
                for (size_t v = 0; v < f.count; ++v) shape[v] = turns[v] * kept[v];
            }
            const double tolerance = tolerance_of(k, rounds->count, rounds->tolerance, f.count);
            fit.round(rounds->gates[k], rounds->smoothing[k], static_cast<size_t>(rounds->strides[k]), tolerance, shape,
                      place);
        }
        return MR_OK;
    });
}

int mr_turned_laplacian(const mr_template* fitted, const double* rest, const double* now, double* shape) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<Matrix> turns;
        std::vector<Vec> kept;
        laplacian(fitted->fitted, rest, kept);
        neighbourhood_turns(fitted->fitted, rest, now, turns);
        for (size_t v = 0; v < kept.size(); ++v) store(shape + 3 * v, turns[v] * kept[v]);
        return MR_OK;
    });
}
