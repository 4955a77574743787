// The nearest of some points in six dimensions: places, and directions that are scaled to lengths.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "lanes.h"

namespace meshreel {

using Point6 = std::array<float, 8>;  // six numbers, and two zeros that fill two lanes

class PointTree {
public:
    explicit PointTree(const std::vector<Point6>& points) : points_(points), order_(points.size()) {
        std::iota(order_.begin(), order_.end(), 0);
        if (!points.empty()) build(0, static_cast<int32_t>(points.size()));
        move(points);
    }

    void move(const std::vector<Point6>& points) {
        points_ = points;
        ordered_.resize(points.size());
        for (size_t k = 0; k < points.size(); ++k) ordered_[k] = points[static_cast<size_t>(order_[k])];
        for (size_t n = nodes_.size(); n-- > 0;) refit(n);
    }

    // The point nearest to a query within a squared reach, the first of several; -1 for none. `guess` may be near, or
    // -1.
    int32_t nearest(const Point6& query, float reach, int32_t guess) const {
        int32_t found = -1;
        float best = reach;
        const auto ask = [&](int32_t point, const Point6& at) {
            const float squared = distance(query, at);
            if (squared < best || (squared == best && point < found)) best = squared, found = point;
        };
        if (guess >= 0) ask(guess, points_[static_cast<size_t>(guess)]);
        struct Waiting {
            float squared;
            int32_t node;
        };
        Waiting stack[64];  // a half has half of the points
        int size = 0;
        if (!nodes_.empty()) stack[size++] = {0.0f, 0};
        while (size > 0) {
            const Waiting next = stack[--size];
            if (!(next.squared <= best)) continue;
            const Node& node = nodes_[static_cast<size_t>(next.node)];
            if (node.right < 0) {
                for (int32_t k = node.begin; k < node.end; ++k)
                    ask(order_[static_cast<size_t>(k)], ordered_[static_cast<size_t>(k)]);
                continue;
            }
            const Waiting left{outside(query, nodes_[static_cast<size_t>(next.node) + 1]), next.node + 1};
            const Waiting right{outside(query, nodes_[static_cast<size_t>(node.right)]), node.right};
            const bool first = left.squared <= right.squared;
            stack[size++] = first ? right : left;
            stack[size++] = first ? left : right;
        }
        return found;
    }

private:
    static constexpr int32_t kLeaf = 8;  // points (guess)

    struct Node {
        Point6 low, high;
        int32_t begin, end, right;  // the left one follows; -1 in leaves
    };

    static float sum_of(Lanes a) { return (a[0] + a[1]) + (a[2] + a[3]); }

    static float distance(const Point6& a, const Point6& b) {
        const Lanes first = load_lanes(&a[0]) - load_lanes(&b[0]), last = load_lanes(&a[4]) - load_lanes(&b[4]);
        return sum_of(first * first + last * last);
    }

    static float outside(const Point6& query, const Node& node) {
        Lanes sum = lanes(0.0f);
        for (size_t d = 0; d < 8; d += 4) {
            const Lanes at = load_lanes(&query[d]), below = load_lanes(&node.low[d]) - at;
            const Lanes out = larger(larger(below, at - load_lanes(&node.high[d])), lanes(0.0f));
            sum = sum + out * out;
        }
        return sum_of(sum);
    }

    void bound(Node& node) const {
        node.low.fill(std::numeric_limits<float>::infinity());
        node.high.fill(-std::numeric_limits<float>::infinity());
        for (int32_t k = node.begin; k < node.end; ++k) {
            const Point6& point = points_[static_cast<size_t>(order_[static_cast<size_t>(k)])];
            widen(node, point, point);
        }
    }

    static void widen(Node& node, const Point6& low, const Point6& high) {
        for (size_t d = 0; d < 8; ++d)
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

    void refit(size_t number) {
        Node& node = nodes_[number];
        if (node.right < 0) {
            bound(node);
            return;
        }
        const Node &left = nodes_[number + 1], &right = nodes_[static_cast<size_t>(node.right)];
        node.low = left.low, node.high = left.high;
        widen(node, right.low, right.high);
    }

    std::vector<Point6> points_, ordered_;  // by number, and as leaves have them
    std::vector<int32_t> order_;
    std::vector<Node> nodes_;  // children after their parents
};

}  // namespace meshreel
