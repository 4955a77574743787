#include "meshreel/deform.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "arrays.h"
#include "deform_equations.h"
#include "guarded.h"
#include "pair_weight.h"
#include "point_tree.h"
#include "rounds.h"
#include "tree_handle.h"

namespace meshreel {
namespace {

constexpr double kNormalReach = 0.01;  // diagonals, weight of a difference of unit normals in a search (guess)
constexpr double kLargestTurn = 0.5;   // rad, of a node in one step (guess)
constexpr double kStill = 1e-4;        // squared row weight of a turn times its lever, for nodes without data (guess)

struct Pair {
    size_t sample;
    Vec normal, point;
    double weight;
};

Matrix load_matrix(const double* m) { return {{load(m), load(m + 3), load(m + 6)}}; }

Point6 placed(Vec point, Vec normal) {
    const Vec n = kNormalReach * normal;
    return {static_cast<float>(point.x), static_cast<float>(point.y), static_cast<float>(point.z),
            static_cast<float>(n.x),     static_cast<float>(n.y),     static_cast<float>(n.z)};
}

class Rounds {
public:
    Rounds(const mr_deformation& graph, const mr_seen& frame, double* rotations, double* positions)
        : graph_(graph), frame_(frame), rotations_(rotations), positions_(positions) {
        points_.resize(graph.sample_count), normals_.resize(graph.sample_count), placed_.resize(graph.sample_count);
        hits_.assign(graph.sample_count, -1), found_.assign(frame.sample_count, -1);
    }

    // Rows of all pairs within the gate.
    std::vector<Pair> pairs(double gate, double agreement) {
        move_samples();
        std::vector<Pair> all;
        for (size_t s = 0; s < graph_.sample_count; ++s) towards(s, gate, agreement, all);
        if (tree_) tree_->move(placed_);
        else tree_.emplace(placed_);
        for (size_t k = 0; k < frame_.sample_count; ++k) back(k, gate, agreement, all);
        return all;
    }

    bool round(double gate, double rigidity, double tolerance, const mr_deform_rounds& rounds) {
        const std::vector<Pair> all = pairs(gate, rounds.agreement);
        double sum = 0.0;
        for (const Pair& pair : all) sum += pair.weight;
        const double scale = std::max(sum / static_cast<double>(graph_.node_count), 1e-12);
        TwistEquations equations(graph_.node_count);
        add_prior(equations, scale, rounds.place);
        for (const Pair& pair : all) add_pair(equations, pair);
        std::vector<double> holds(graph_.edge_count);
        find_holds(rounds.torn, holds.data());
        for (size_t e = 0; e < graph_.edge_count; ++e) add_edge(equations, e, std::sqrt(rigidity * holds[e] * scale));
        std::vector<float> x;
        equations.solve(rounds.iterations, tolerance, x);
        return take(x);
    }

    void find_holds(double torn, double* holds) const {
        for (size_t e = 0; e < graph_.edge_count; ++e) {
            const Vec arm = arm_of(e), gap = tear(e);
            const double share = dot(gap, gap) / std::max(dot(arm, arm), 1e-18), grown = 1.0 + share / (torn * torn);
            holds[e] = graph_.held[e] / (grown * grown);
        }
    }

private:
    Vec node(int32_t n) const { return load(graph_.nodes + 3 * static_cast<size_t>(n)); }
    Matrix turn_of(int32_t n) const { return load_matrix(rotations_ + 9 * static_cast<size_t>(n)); }
    Vec place_of(int32_t n) const { return load(positions_ + 3 * static_cast<size_t>(n)); }
    int32_t end(size_t e, size_t side) const { return graph_.edges[2 * e + side]; }
    Vec arm_of(size_t e) const { return node(end(e, 1)) - node(end(e, 0)); }
    Vec tear(size_t e) const { return turn_of(end(e, 0)) * arm_of(e) + place_of(end(e, 0)) - place_of(end(e, 1)); }

    void move_samples() {
        for (size_t s = 0; s < graph_.sample_count; ++s) {
            const Vec point = load(graph_.points + 3 * s), normal = load(graph_.normals + 3 * s);
            Vec moved{0, 0, 0}, turned{0, 0, 0};
            for (size_t k = 0; k < graph_.bonds; ++k) {
                const int32_t n = graph_.bound[graph_.bonds * s + k];
                const double weight = graph_.weights[graph_.bonds * s + k];
                const Matrix turn = turn_of(n);
                moved = moved + weight * (turn * (point - node(n)) + place_of(n));
                turned = turned + weight * (turn * normal);
            }
            points_[s] = moved, normals_[s] = unit(turned);
            placed_[s] = placed(points_[s], normals_[s]);
        }
    }

    // Pulls a sample of the mesh to the frame's surface.
    void towards(size_t s, double gate, double agreement, std::vector<Pair>& all) {
        const Hit hit = tree_of(frame_.tree).closest(points_[s], gate, hits_[s]);
        if (hit.face < 0) return;
        hits_[s] = hit.face;
        Vec closest{0, 0, 0}, normal{0, 0, 0};
        double inside = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            const size_t corner = static_cast<size_t>(frame_.mesh.faces[3 * static_cast<size_t>(hit.face) + k]);
            closest = closest + hit.weights[k] * load(frame_.mesh.positions + 3 * corner);
            normal = normal + hit.weights[k] * load(frame_.normals + 3 * corner);
            inside += hit.weights[k] * frame_.inside[corner];
        }
        normal = unit(normal);
        const double away = length(points_[s] - closest) / gate;
        const double weight = inside * pair_weight(away, dot(normal, normals_[s]), agreement);
        if (weight > 0.0) all.push_back({s, normal, closest, weight});
    }

    // Pulls the sample of the mesh that is nearest to a sample of the frame to the plane there.
    void back(size_t k, double gate, double agreement, std::vector<Pair>& all) {
        const Vec point = load(frame_.points + 3 * k), normal = load(frame_.point_normals + 3 * k);
        const double far = gate + frame_.spacing, reach = far * far + 4.0 * kNormalReach * kNormalReach;
        found_[k] = tree_->nearest(placed(point, normal), static_cast<float>(reach), found_[k]);
        if (found_[k] < 0) return;
        const size_t s = static_cast<size_t>(found_[k]);
        const Vec offset = points_[s] - point;
        const double away = std::max(std::fabs(dot(offset, normal)), length(offset) - frame_.spacing) / gate;
        const double weight = pair_weight(away, dot(normal, normals_[s]), agreement);
        if (weight > 0.0) all.push_back({s, normal, point, weight});
    }

    void add_prior(TwistEquations& equations, double scale, double place) const {
        std::vector<double> squares(graph_.node_count, 0.0), counts(graph_.node_count, 0.0), all;
        for (size_t e = 0; e < graph_.edge_count; ++e) {
            const double square = dot(arm_of(e), arm_of(e));
            squares[static_cast<size_t>(end(e, 0))] += square, counts[static_cast<size_t>(end(e, 0))] += 1.0;
            all.push_back(square);
        }
        double usual = 1e-4;
        if (!all.empty()) {  // the median
            std::sort(all.begin(), all.end());
            usual = 0.5 * (all[(all.size() - 1) / 2] + all[all.size() / 2]);
        }
        for (size_t n = 0; n < graph_.node_count; ++n) {
            const double lever = std::max(squares[n] / std::max(counts[n], 1.0), 0.1 * usual);
            equations.add_prior(n, kStill * scale * lever, place * scale);
        }
    }

    void add_pair(TwistEquations& equations, const Pair& pair) const {
        const Vec point = load(graph_.points + 3 * pair.sample);
        const double root = std::sqrt(pair.weight);
        equations.begin_row(root * dot(pair.normal, pair.point - points_[pair.sample]));
        for (size_t k = 0; k < graph_.bonds; ++k) {
            const int32_t n = graph_.bound[graph_.bonds * pair.sample + k];
            const double weight = root * graph_.weights[graph_.bonds * pair.sample + k];
            const Vec arm = turn_of(n) * (point - node(n));
            equations.add(n, weight * cross(arm, pair.normal), weight * pair.normal);
        }
    }

    // Rows of turn_i x arm + step_i - step_j.
    void add_edge(TwistEquations& equations, size_t e, double root) const {
        const int32_t i = end(e, 0), j = end(e, 1);
        const Vec arm = root * (turn_of(i) * arm_of(e)), miss = -root * tear(e);
        const Vec turns[3] = {{0, arm.z, -arm.y}, {-arm.z, 0, arm.x}, {arm.y, -arm.x, 0}};
        const Vec axes[3] = {{root, 0, 0}, {0, root, 0}, {0, 0, root}};
        const double misses[3] = {miss.x, miss.y, miss.z};
        for (int d = 0; d < 3; ++d) {
            equations.begin_row(misses[d]);
            equations.add(i, turns[d], axes[d]);
            equations.add(j, {0, 0, 0}, -1.0 * axes[d]);
        }
    }

    // Takes the step unless it gives numbers that are not finite.
    bool take(const std::vector<float>& x) {
        for (float value : x)
            if (!std::isfinite(value)) return false;
        for (size_t n = 0; n < graph_.node_count; ++n) {
            const float* step = &x[kTwist * n];
            const Vec turned{static_cast<double>(step[0]), static_cast<double>(step[1]), static_cast<double>(step[2])};
            const double angle = length(turned);
            const Matrix now = product(turn(std::min(1.0, kLargestTurn / std::max(angle, 1e-12)) * turned),
                                       load_matrix(rotations_ + 9 * n));
            for (size_t r = 0; r < 3; ++r) store(rotations_ + 9 * n + 3 * r, now.row[r]);
            for (size_t d = 0; d < 3; ++d) positions_[3 * n + d] += static_cast<double>(step[3 + d]);
        }
        return true;
    }

    const mr_deformation& graph_;
    const mr_seen& frame_;
    double *rotations_, *positions_;
    std::vector<Vec> points_, normals_;
    std::vector<Point6> placed_;
    std::vector<int32_t> hits_, found_;  // of each sample of the mesh a face, of each of the frame a sample of the mesh
    std::optional<PointTree> tree_;
};

bool is_valid(const mr_deformation& graph, const mr_seen& frame, const double* gates, size_t rounds) {
    for (size_t k = 0; k < rounds; ++k)
        if (!(gates[k] > 0.0)) return false;
    return graph.node_count > 0 && in_range(graph.edges, 2 * graph.edge_count, graph.node_count) &&
           in_range(graph.bound, graph.bonds * graph.sample_count, graph.node_count) &&
           tree_of(frame.tree).face_count() == frame.mesh.face_count &&
           in_range(frame.mesh.faces, 3 * frame.mesh.face_count, frame.mesh.vertices);
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_deform(const mr_deformation* graph, const mr_seen* frame, const mr_deform_rounds* rounds, double* rotations,
              double* positions) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (!is_valid(*graph, *frame, rounds->gates, rounds->count)) return MR_BAD_INPUT;
        Rounds state(*graph, *frame, rotations, positions);
        for (size_t k = 0; k < rounds->count; ++k) {
            const double tolerance = tolerance_of(k, rounds->count, rounds->tolerance, graph->sample_count);
            if (!state.round(rounds->gates[k], rounds->rigidity[k], tolerance, *rounds)) break;
        }
        return MR_OK;
    });
}

int mr_deform_matched(const mr_deformation* graph, const mr_seen* frame, double gate, double agreement,
                      const double* rotations, const double* positions, double* sum) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (!is_valid(*graph, *frame, &gate, 1)) return MR_BAD_INPUT;
        std::vector<double> turns(rotations, rotations + 9 * graph->node_count);
        std::vector<double> places(positions, positions + 3 * graph->node_count);
        Rounds state(*graph, *frame, turns.data(), places.data());
        *sum = 0.0;
        for (const Pair& pair : state.pairs(gate, agreement)) *sum += pair.weight;
        return MR_OK;
    });
}

int mr_deform_holds(const mr_deformation* graph, double torn, const double* rotations, const double* positions,
                    double* holds) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        const mr_seen nothing{};
        std::vector<double> turns(rotations, rotations + 9 * graph->node_count);
        std::vector<double> places(positions, positions + 3 * graph->node_count);
        if (!in_range(graph->edges, 2 * graph->edge_count, graph->node_count)) return MR_BAD_INPUT;
        Rounds(*graph, nothing, turns.data(), places.data()).find_holds(torn, holds);
        return MR_OK;
    });
}
