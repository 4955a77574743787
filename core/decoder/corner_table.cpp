#include "corner_table.h"

#include <unordered_map>

#include "../src/format_error.h"

namespace meshreel {
namespace {

using namespace clers;

// Bits coded by an asymmetric numeral system (J. Duda), read from the last byte to the first.
class StartBits {
public:
    StartBits(DracoReader in, uint8_t chance) : of_one_(256u - chance) {
        const uint64_t size = in.left();
        const uint8_t* data = in.take(size);
        const uint64_t bytes = size > 0 ? uint64_t{data[size - 1]} / 64 + 1 : 4;
        if (bytes > 3 || bytes > size) throw FormatError("the starts of its components are damaged");
        data_ = data, left_ = size - bytes;
        for (uint64_t b = bytes; b > 0; --b) state_ = state_ << 8 | data[left_ + b - 1];
        state_ = (state_ & (~0u >> (34 - 8 * bytes))) + kLow;
        if (state_ >= 256 * kLow) throw FormatError("the starts of its components are damaged");
    }

    bool next() {
        if (state_ < kLow && left_ > 0) state_ = state_ << 8 | data_[--left_];
        const uint32_t share = state_ / 256 * of_one_, place = state_ % 256;
        const bool bit = place < of_one_;
        state_ = bit ? share + place : state_ - share - of_one_;
        return bit;
    }

private:
    static constexpr uint32_t kLow = 4096;
    const uint8_t* data_ = nullptr;
    uint64_t left_ = 0;
    uint32_t of_one_, state_ = 0;
};

// Puts face after face to the active edge, which is told by the corner that faces it.
class Builder {
public:
    Builder(const DracoFaces& faces, const DracoClaims& claims) : faces_(faces), claims_(claims) {
        const size_t corners = 3 * static_cast<size_t>(claims.faces);
        table_.vertices.reserve(corners);
        table_.opposite.reserve(corners);
        table_.leftmost.reserve(static_cast<size_t>(claims.points + claims.splits));
    }

    CornerTable build() {
        std::vector<DracoHandle> handles = faces_.handles;
        for (uint64_t k = 0; k < faces_.symbols.size(); ++k) {
            const uint64_t number = claims_.symbols - 1 - k;
            add(faces_.symbols[k], number);
            for (; !handles.empty() && handles.back().source == number; handles.pop_back())
                waiting_[handles.back().split] = handles.back().is_right ? next_corner(top()) : previous_corner(top());
        }
        add_starts();
        require(table_.vertices.size() == 3 * claims_.faces);
        fill_gaps();
        require(table_.leftmost.size() == claims_.points);
        return std::move(table_);
    }

private:
    static void require(bool holds) {
        if (!holds) throw FormatError("its faces are those of no surface");
    }

    int32_t top() const { return stack_.back(); }
    int32_t vertex(int32_t corner) const { return table_.vertices[corner]; }

    void add(uint8_t symbol, uint64_t number) {
        if (symbol == E) return start();
        if (symbol == S) return join(number);
        require(!stack_.empty());
        if (symbol == C) close();
        else extend(symbol == R);
    }

    int32_t add_face(int32_t a, int32_t b, int32_t c) {
        const int32_t corner = static_cast<int32_t>(table_.vertices.size());
        table_.vertices.insert(table_.vertices.end(), {a, b, c});
        table_.opposite.insert(table_.opposite.end(), 3, kNoCorner);
        return corner;
    }

    int32_t add_vertex(int32_t corner) {
        table_.leftmost.push_back(corner);
        return static_cast<int32_t>(table_.leftmost.size()) - 1;
    }

    void oppose(int32_t a, int32_t b) {
        require(table_.opposite[a] == kNoCorner && table_.opposite[b] == kNoCorner && a != b);
        table_.opposite[a] = b, table_.opposite[b] = a;
    }

    // The corner that faces the border edge behind a vertex.
    int32_t behind(int32_t vertex) const {
        require(table_.leftmost[vertex] != kNoCorner);
        return next_corner(table_.leftmost[vertex]);
    }

    void start() {
        const int32_t corner = static_cast<int32_t>(table_.vertices.size());
        const int32_t a = add_vertex(corner), b = add_vertex(corner + 1), c = add_vertex(corner + 2);
        stack_.push_back(add_face(a, b, c));
    }

    // A face with a vertex of its own; the active edge becomes its right one, or its left one.
    void extend(bool is_right) {
        const int32_t old = top(), left = vertex(next_corner(old)), right = vertex(previous_corner(old));
        const int32_t corner = static_cast<int32_t>(table_.vertices.size()), tip = corner + (is_right ? 2 : 1);
        const int32_t made = add_vertex(tip);
        if (is_right) add_face(right, left, made), table_.leftmost[right] = corner;
        else add_face(left, made, right), table_.leftmost[right] = corner + 2;
        oppose(tip, old);
        stack_.back() = corner;
    }

    // A face between the active edge and the one beside it: the vertex that they share is no more on the border.
    void close() {
        const int32_t a = top(), x = vertex(next_corner(a)), b = behind(x);
        const int32_t before = vertex(previous_corner(a)), after = vertex(next_corner(b));
        require(a != b && x != before && x != after);
        const int32_t corner = add_face(x, after, before);
        oppose(a, corner + 1), oppose(b, corner + 2);
        table_.leftmost[before] = corner + 2;
        stack_.back() = corner;
    }

    // A face between two active edges, of which the second may have waited.
    void join(uint64_t number) {
        require(!stack_.empty());
        const int32_t b = top();
        stack_.pop_back();
        const auto found = waiting_.find(number);
        if (found != waiting_.end()) stack_.push_back(found->second);
        require(!stack_.empty());
        const int32_t a = top(), kept = vertex(previous_corner(a)), end = vertex(previous_corner(b));
        const int32_t corner = add_face(kept, vertex(next_corner(a)), end);
        oppose(a, corner + 2), oppose(b, corner + 1);
        table_.leftmost[end] = corner + 2;
        merge(vertex(next_corner(b)), kept, next_corner(b));
        stack_.back() = corner;
    }

    void merge(int32_t gone, int32_t kept, int32_t first) {
        table_.leftmost[kept] = table_.leftmost[gone];
        int32_t corner = first;
        do {
            table_.vertices[corner] = kept;
            corner = table_.swing_left(corner);
            require(corner != first);
        } while (corner != kNoCorner);
        table_.leftmost[gone] = kNoCorner;
        gone_.push_back(gone);
    }

    // The faces that components start with, where these are within their surfaces: they close what is left open.
    void add_starts() {
        StartBits bits(faces_.starts, faces_.start_chance);
        for (; !stack_.empty(); stack_.pop_back()) {
            if (!bits.next()) continue;
            require(table_.vertices.size() < 3 * claims_.faces);
            const int32_t a = top(), n = vertex(next_corner(a)), b = behind(n), x = vertex(next_corner(b));
            const int32_t c = behind(x), p = vertex(next_corner(c));
            require(a != b && b != c && c != a);
            const int32_t corner = add_face(x, p, n);
            oppose(corner, a), oppose(corner + 1, b), oppose(corner + 2, c);
        }
    }

    // Gives the last vertices the numbers of those that were merged into others.
    void fill_gaps() {
        std::vector<int32_t>& leftmost = table_.leftmost;
        for (const int32_t missing : gone_) {
            while (!leftmost.empty() && leftmost.back() == kNoCorner) leftmost.pop_back();
            const int32_t last = static_cast<int32_t>(leftmost.size()) - 1;
            if (last < missing) continue;
            rename(last, missing);
            leftmost[missing] = leftmost[last];
            leftmost.pop_back();
        }
        while (!leftmost.empty() && leftmost.back() == kNoCorner) leftmost.pop_back();
    }

    void rename(int32_t from, int32_t to) {
        const int32_t first = table_.leftmost[from];
        int32_t corner = first;
        do {
            require(table_.vertices[corner] == from);
            table_.vertices[corner] = to;
            corner = table_.swing_right(corner);
        } while (corner != kNoCorner && corner != first);
    }

    const DracoFaces& faces_;
    const DracoClaims& claims_;
    CornerTable table_;
    std::vector<int32_t> stack_, gone_;
    std::unordered_map<uint64_t, int32_t> waiting_;  // corners that face them, by the symbol of the split
};

}  // namespace

CornerTable make_corners(const DracoFaces& faces, const DracoClaims& claims) { return Builder(faces, claims).build(); }

}  // namespace meshreel
