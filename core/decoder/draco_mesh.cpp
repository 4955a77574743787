#include "draco_mesh.h"

#include <cmath>

#include "../src/draco_head.h"
#include "../src/format_error.h"
#include "corner_table.h"

namespace meshreel {
namespace {

// The order in which vertices have their positions: depth first over the faces, the right one before the left.
class Order {
public:
    explicit Order(const CornerTable& table)
        : table_(table), is_seen_(table.vertices.size() / 3), place_of(table.leftmost.size(), kNone) {
        corners.reserve(place_of.size());
        for (size_t face = 0; face < is_seen_.size(); ++face) follow(static_cast<int32_t>(3 * face));
    }

private:
    bool is_done(int32_t corner) const { return corner == kNoCorner || is_seen_[corner / 3]; }

    // Whether the corner's vertex had no place before.
    bool visit(int32_t corner) {
        int32_t& place = place_of[table_.vertices[corner]];
        if (place != kNone) return false;
        place = static_cast<int32_t>(corners.size());
        corners.push_back(corner);
        return true;
    }

    bool is_on_border(int32_t corner) const {
        return table_.swing_left(table_.leftmost[table_.vertices[corner]]) == kNoCorner;
    }

    void follow(int32_t first) {
        if (is_done(first)) return;
        visit(next_corner(first));
        visit(previous_corner(first));
        stack_.assign(1, first);
        while (!stack_.empty()) {
            const int32_t corner = stack_.back();
            if (is_done(corner)) stack_.pop_back();
            else walk(corner);
        }
    }

    // Goes from face to face until there are two ways, or none.
    void walk(int32_t corner) {
        while (true) {
            is_seen_[corner / 3] = true;
            const int32_t right = table_.right_of(corner), left = table_.left_of(corner);
            if (visit(corner) && !is_on_border(corner)) {
                if (is_done(right)) return;
                corner = right;
            } else if (!is_done(right) && !is_done(left)) {
                stack_.back() = left;
                stack_.push_back(right);
                return;
            } else if (is_done(right) && is_done(left)) {
                stack_.pop_back();
                return;
            } else {
                corner = is_done(right) ? left : right;
            }
        }
    }

    const CornerTable& table_;
    std::vector<bool> is_seen_;
    std::vector<int32_t> stack_;

public:
    static constexpr int32_t kNone = -1;
    std::vector<int32_t> corners;   // of each place, the corner at which its vertex was found
    std::vector<int32_t> place_of;  // of each vertex
};

// Coordinates of each place on the lattice.
class Lattice {
public:
    Lattice(const CornerTable& table, const Order& order, const DracoPositions& coded)
        : table_(table), order_(order), coded_(coded), span_(int64_t{1} + coded.most - coded.least) {
        require(coded.least <= coded.most && coded.corrections.size() == 3 * order.corners.size(),
                "damaged Draco data: positions that are not those of its faces");
        values.resize(coded.corrections.size());
        for (size_t place = 0; place < order.corners.size(); ++place) put(place);
    }

    std::vector<int64_t> values;

private:
    void put(size_t place) {
        int64_t predicted[3] = {0, 0, 0};
        if (place > 0 && !from_parallelogram(place, predicted))
            for (size_t k = 0; k < 3; ++k) predicted[k] = values[3 * (place - 1) + k];
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t coded = coded_.corrections[3 * place + k];
            const int64_t half = coded >> 1, correction = coded & 1 ? -half - 1 : half;
            values[3 * place + k] = wrapped(predicted[k], correction);
        }
    }

    // The fourth corner of a parallelogram, over the edge that the place's corner faces.
    bool from_parallelogram(size_t place, int64_t* predicted) const {
        const int32_t corner = table_.opposite[order_.corners[place]];
        if (corner == kNoCorner) return false;
        const auto at = [&](int32_t c) { return static_cast<size_t>(order_.place_of[table_.vertices[c]]); };
        const size_t a = at(next_corner(corner)), b = at(previous_corner(corner)), c = at(corner);
        if (a >= place || b >= place || c >= place) return false;
        for (size_t k = 0; k < 3; ++k) predicted[k] = values[3 * a + k] + values[3 * b + k] - values[3 * c + k];
        return true;
    }

    int64_t wrapped(int64_t predicted, int64_t correction) const {
        const int64_t from = predicted < coded_.least  ? coded_.least
                             : predicted > coded_.most ? coded_.most
                                                       : predicted;
        const int64_t sum = from + correction;
        const int64_t value = sum > coded_.most ? sum - span_ : sum < coded_.least ? sum + span_ : sum;
        return static_cast<int32_t>(static_cast<uint32_t>(value));  // as 32 bits hold it
    }

    const CornerTable& table_;
    const Order& order_;
    const DracoPositions& coded_;
    int64_t span_;
};

void place(const DracoPositions& coded, const Order& order, const Lattice& lattice, double step, Mesh& mesh) {
    const float cell = coded.width / static_cast<float>((1u << coded.bits) - 1);
    for (size_t v = 0; v < order.place_of.size(); ++v) {
        const size_t from = 3 * static_cast<size_t>(order.place_of[v]);
        for (size_t k = 0; k < 3; ++k) {
            const float scaled = static_cast<float>(static_cast<int32_t>(lattice.values[from + k])) * cell;
            const float value = scaled + coded.corner[k];
            const double number = std::nearbyint(static_cast<double>(value) / step) * step;
            require(std::isfinite(number), "damaged Draco data: positions are not finite");
            mesh.vertices[3 * v + k] = number;
        }
    }
}

}  // namespace

Mesh decode_draco(const mr_bytes& data, double step) {
    Mesh mesh;
    if (data.size == 0) return mesh;
    DracoParts parts;
    check(read_draco(data, parts), "damaged Draco data: ");
    CornerTable table = make_corners(parts.faces, parts.claims);
    const Order order(table);
    const Lattice lattice(table, order, parts.positions);
    mesh.vertices.resize(3 * order.place_of.size());
    require(order.corners.size() == order.place_of.size(), "damaged Draco data: a vertex without a face");
    place(parts.positions, order, lattice, step, mesh);
    mesh.faces = std::make_shared<const std::vector<int32_t>>(std::move(table.vertices));
    return mesh;
}

}  // namespace meshreel
