#include "grounded_solver.h"

#include <algorithm>

#include <Eigen/SparseCore>

namespace meshreel {
namespace {

constexpr int64_t kMostAnchors = 32;  // of a component; each costs as much as a further column (decision 21)

}  // namespace

GroundedSolver::Outcome GroundedSolver::compute(const SparseRows& rows, const std::vector<int32_t>& anchors,
                                                double anchor_weight) {
    rows_ = &rows, anchor_weight_ = anchor_weight;
    label(rows);
    for (int32_t a : anchors) components_[component_of_[a]].anchors.push_back(a);
    std::vector<int32_t> grounds;
    for (Component& component : components_) {
        if (component.ground >= 0) {
            if (component.anchors.empty()) return Outcome::kSingular;
            component.ground = component.anchors.front();
            grounds.push_back(component.ground);
        }
        most_anchors_ = std::max(most_anchors_, static_cast<int64_t>(component.anchors.size()));
    }
    if (!factor_.order(rows)) return Outcome::kSingular;
    if (most_anchors_ > kMostAnchors) return Outcome::kTooManyAnchors;
    if (!factor_.compute(rows, grounds)) return Outcome::kSingular;
    responses_.assign(component_of_.size() * static_cast<size_t>(most_anchors_), 0.0);
    for (const Component& component : components_)
        for (size_t k = 0; k < component.anchors.size(); ++k)
            responses_[component.anchors[k] * most_anchors_ + k] = 1.0;
    factor_.solve(responses_, most_anchors_);
    for (Component& component : components_)
        if (!factor_capacitance(component)) return Outcome::kSingular;
    return Outcome::kReady;
}

// Connected components, in the order of their first vertices; `ground` marks for now that there are edges.
void GroundedSolver::label(const SparseRows& rows) {
    const int32_t n = static_cast<int32_t>(rows.starts.size()) - 1;
    component_of_.assign(n, -1);
    std::vector<int32_t> queue;
    for (int32_t first = 0; first < n; ++first) {
        if (component_of_[first] >= 0) continue;
        const int32_t number = static_cast<int32_t>(components_.size());
        components_.emplace_back();
        if (rows.starts[first] != rows.starts[first + 1]) components_.back().ground = first;
        component_of_[first] = number;
        queue.assign(1, first);
        for (size_t head = 0; head < queue.size(); ++head)
            for (int64_t p = rows.starts[queue[head]]; p < rows.starts[queue[head] + 1]; ++p) {
                int32_t& label = component_of_[rows.columns[p]];
                if (label < 0) label = number, queue.push_back(rows.columns[p]);
            }
    }
}

// C has w^2 for each anchor, 1 more at the ground's, and -1 between that and the term of B^T g, whose own is 0. Its
// inverse: 1 / w^2 for other anchors, 0 for the ground's, -1 between it and the last term, whose own is -(w^2 + 1).
// (B^T B)^-1 B^T g is 1 everywhere, so F^T of it is 1 at all anchors and, as B 1 = g, in the last term: there -w^2
// remains, and 0 between it and the ground's. Without the last term what is left is positive definite.
bool GroundedSolver::factor_capacitance(Component& component) const {
    const int64_t count = static_cast<int64_t>(component.anchors.size());
    const double loose = 1.0 / (anchor_weight_ * anchor_weight_);
    Eigen::SparseMatrix<double> lower(count, count);
    for (int64_t b = 0; b < count; ++b) {
        lower.startVec(b);
        for (int64_t a = b; a < count; ++a) {
            double value = responses_[component.anchors[a] * most_anchors_ + b];
            if (component.ground >= 0 && b > 0) value += loose;  // of the last term
            if (a == b && (component.ground < 0 || b > 0)) value += loose;
            lower.insertBack(a, b) = value;
        }
    }
    lower.finalize();
    return component.capacitance.compute(lower);
}

// What the terms of F take from x in a component: terms x columns, that of B^T g last.
std::vector<double> GroundedSolver::correction(const Component& component, const double* x, int64_t columns) const {
    const int64_t count = static_cast<int64_t>(component.anchors.size()), ground = component.ground;
    const double loose = 1.0 / (anchor_weight_ * anchor_weight_);
    std::vector<double> seen(static_cast<size_t>(count * columns)), last(static_cast<size_t>(columns), 0.0);
    if (ground >= 0) {  // (B x) there: the diagonal is 1 and 1 more
        for (int64_t c = 0; c < columns; ++c) last[c] = 2.0 * x[ground * columns + c];
        for (int64_t p = rows_->starts[ground]; p < rows_->starts[ground + 1]; ++p)
            for (int64_t c = 0; c < columns; ++c) last[c] -= rows_->values[p] * x[rows_->columns[p] * columns + c];
    }
    for (int64_t a = 0; a < count; ++a)
        for (int64_t c = 0; c < columns; ++c)
            seen[a * columns + c] = x[component.anchors[a] * columns + c] + (a > 0 ? loose * last[c] : 0.0);
    std::vector<double> amounts(static_cast<size_t>((count + 1) * columns), 0.0);
    component.capacitance.solve(seen.data(), columns, amounts.data());
    for (int64_t c = 0; c < columns; ++c) {
        double& amount = amounts[count * columns + c];
        amount = -last[c];
        for (int64_t a = 1; a < count; ++a) amount += amounts[a * columns + c];
        amount *= ground >= 0 ? loose : 0.0;
    }
    return amounts;
}

void GroundedSolver::solve(std::vector<double>& x, int64_t columns) const {
    factor_.solve(x, columns);
    std::vector<std::vector<double>> amounts;
    for (const Component& component : components_) amounts.push_back(correction(component, x.data(), columns));
    for (size_t v = 0; v < component_of_.size(); ++v) {
        const int64_t count = static_cast<int64_t>(components_[component_of_[v]].anchors.size());
        const double* amount = amounts[component_of_[v]].data();
        double* to = x.data() + v * columns;
        for (int64_t a = 0; a < count; ++a)
            for (int64_t c = 0; c < columns; ++c) to[c] -= responses_[v * most_anchors_ + a] * amount[a * columns + c];
        for (int64_t c = 0; c < columns; ++c) to[c] -= amount[count * columns + c];
    }
}

}  // namespace meshreel
