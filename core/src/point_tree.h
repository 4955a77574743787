// The nearest of some points in six dimensions: places, and directions that are scaled to lengths.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace meshreel {

using Point6 = std::array<float, 6>;

class PointTree {
public:
    explicit PointTree(const std::vector<Point6>& points) : points_(points), order_(points.size()) {
        std::iota(order_.begin(), order_.end(), 0);
        if (!points.empty()) build(0, static_cast<int32_t>(points.size()));
        refit();
    }

    void move(const std::vector<Point6>& points) {
        points_ = points;
        refit();
    }

    // The point nearest to a query within a squared reach, the first of several; -1 for none. `guess` may be near, or
    // -1.
    int32_t nearest(const Point6& query, float reach, int32_t guess) const {
        int32_t found = -1;
        float best = reach;
        const auto ask = [&](int32_t point) {
            const float squared = distance(query, points_[static_cast<size_t>(point)]);
            if (squared < best || (squared == best && point < found)) best = squared, found = point;
        };
        if (guess >= 0) ask(guess);
        int32_t stack[64];  // a half has half of the points
        int size = 0;
        if (!nodes_.empty()) stack[size++] = 0;
        while (size > 0) {
            const Node& node = nodes_[static_cast<size_t>(stack[--size])];
            if (!(outside(query, node) <= best)) continue;
            if (node.right < 0) {
                for (int32_t k = node.begin; k < node.end; ++k) ask(order_[static_cast<size_t>(k)]);
                continue;
            }
            const int32_t left = static_cast<int32_t>(&node - nodes_.data()) + 1;
            const bool first = outside(query, nodes_[static_cast<size_t>(left)]) <=
                               outside(query, nodes_[static_cast<size_t>(node.right)]);
            stack[size++] = first ? node.right : left;
            stack[size++] = first ? left : node.right;
        }
        return found;
    }

private:
    static constexpr int32_t kLeaf = 8;  // points (guess)

    struct Node {
        Point6 low, high;
        int32_t begin, end, right;  // the left one follows; -1 in leaves
    };

    static float distance(const Point6& a, const Point6& b) {
        float sum = 0.0f;
        for (size_t d = 0; d < 6; ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
        return sum;
    }

    static float outside(const Point6& query, const Node& node) {
        float sum = 0.0f;
        for (size_t d = 0; d < 6; ++d) {
            const float out = std::max(std::max(node.low[d] - query[d], query[d] - node.high[d]), 0.0f);
            sum += out * out;
        }
        return sum;
    }

    void bound(Node& node) const {
        node.low.fill(std::numeric_limits<float>::infinity());
        node.high.fill(-std::numeric_limits<float>::infinity());
        for (int32_t k = node.begin; k < node.end; ++k) widen(node, points_[order_[k]], points_[order_[k]]);
    }

    static void widen(Node& node, const Point6& low, const Point6& high) {
        for (size_t d = 0; d < 6; ++d)
            node.low[d] = std::min(node.low[d], low[d]), node.high[d] = std::max(node.high[d], high[d]);
    }

    int32_t build(int32_t begin, int32_t end) {
        const size_t number = nodes_.size();
        nodes_.push_back({{}, {}, begin, end, -1});
        if (end - begin <= kLeaf) return static_cast<int32_t>(number);
        bound(nodes_[number]);
        size_t axis = 0;
        const auto size = [&](size_t d) { return nodes_[number].high[d] - nodes_[number].low[d]; };
        for (size_t d = 1; d < 6; ++d)
            if (size(d) > size(axis)) axis = d;
        std::sort(order_.begin() + begin, order_.begin() + end, [&](int32_t a, int32_t b) {
            return points_[a][axis] != points_[b][axis] ? points_[a][axis] < points_[b][axis] : a < b;
        });
        const int32_t middle = begin + (end - begin) / 2;
        build(begin, middle);
        const int32_t right = build(middle, end);
        nodes_[number].right = right;
        return static_cast<int32_t>(number);
    }

    void refit() {
        for (size_t n = nodes_.size(); n-- > 0;) {
            Node& node = nodes_[n];
            bound_from_below(node, n);
        }
    }

    void bound_from_below(Node& node, size_t number) {
        if (node.right < 0) {
            bound(node);
            return;
        }
        const Node &left = nodes_[number + 1], &right = nodes_[static_cast<size_t>(node.right)];
        node.low = left.low, node.high = left.high;
        widen(node, right.low, right.high);
    }

    std::vector<Point6> points_;
    std::vector<int32_t> order_;
    std::vector<Node> nodes_;  // children after their parents
};

}  // namespace meshreel
