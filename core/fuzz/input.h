// A fuzzer's bytes as the arguments of a call, within what Python and the player check before they call.
//
// A stream of symbols is taken as it is, or made by the coder from numbers: then lengths and ends are right, and what
// lies behind them is reached.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "meshreel/entropy.h"
#include "meshreel/layers.h"

namespace meshreel {

using Bytes = std::vector<uint8_t>;

#define LAW(holds)                                                                   \
    do {                                                                             \
        if (holds) break;                                                            \
        std::fprintf(stderr, "%s:%d: broken law: %s\n", __FILE__, __LINE__, #holds); \
        std::abort();                                                                \
    } while (false)

// Bytes in turn; zeros behind the end.
class Input {
public:
    Input(const uint8_t* data, size_t size) : at_(data), end_(data + size) {}

    uint8_t u8() { return at_ < end_ ? *at_++ : 0; }
    uint32_t u16() {
        const uint32_t low = u8();
        return low | static_cast<uint32_t>(u8()) << 8;
    }
    uint32_t u32() {
        const uint32_t low = u16();
        return low | u16() << 16;
    }
    int16_t i16() { return static_cast<int16_t>(u16()); }
    // Small numbers in one byte; -128 announces four bytes of any number.
    int32_t number() {
        const int8_t small = static_cast<int8_t>(u8());
        return small == -128 ? static_cast<int32_t>(u32()) : small;
    }
    double scale() { return std::ldexp(1.0, 7 * static_cast<int8_t>(u8())); }  // times an i16 it is finite
    Bytes bytes() {
        size_t size = u16();
        const size_t left = static_cast<size_t>(end_ - at_);
        if (size > left) size = left;
        Bytes out(at_, at_ + size);
        at_ += size;
        return out;
    }

private:
    const uint8_t *at_, *end_;
};

struct Mesh {
    std::vector<double> positions;
    std::vector<int32_t> faces;
    size_t vertices() const { return positions.size() / 3; }
    size_t face_count() const { return faces.size() / 3; }
    mr_mesh view() const { return {positions.data(), vertices(), faces.data(), face_count()}; }
};

constexpr uint32_t kMostPlaces = 60;     // of a graph
constexpr uint32_t kMostVertices = 128;  // and twice as many faces, so that a run takes under a millisecond

// A mesh whose faces name its vertices, or, once in a while, others.
inline Mesh mesh_of(Input& in, uint32_t most_vertices = kMostVertices) {
    Mesh mesh;
    const uint32_t vertices = in.u16() % most_vertices, faces = in.u16() % (2 * most_vertices);
    const bool is_bad = in.u8() == 255;
    const double scale = in.scale();
    mesh.positions.resize(3 * vertices);
    for (double& x : mesh.positions) x = scale * in.i16();
    mesh.faces.resize(vertices > 0 || is_bad ? 3 * faces : 0);
    for (int32_t& corner : mesh.faces)
        corner = is_bad ? in.number() : static_cast<int32_t>(vertices < 256 ? in.u8() % vertices : in.u16() % vertices);
    return mesh;
}

// A stream: bytes as they are, or `encode`d from `count` numbers, and then perhaps damaged.
template <class Encode>
Bytes stream_of(Input& in, size_t count, Encode encode) {
    const uint8_t mode = in.u8();
    if (mode % 2 == 0 || count > 20000) return in.bytes();
    std::vector<int32_t> numbers(count);
    for (int32_t& number : numbers) number = in.number();
    Bytes out = encode(numbers);
    if (mode & 2 && !out.empty()) out[in.u16() % out.size()] ^= in.u8();
    if (mode & 4) out.resize(out.size() + in.u8() % 3);
    if (mode & 8 && !out.empty()) out.pop_back();
    return out;
}

inline Bytes encoded_integers(const std::vector<int32_t>& numbers) {
    Bytes out(8 * numbers.size() + 16);
    size_t size = 0;
    LAW(mr_encode_integers(numbers.data(), numbers.size(), out.data(), out.size(), &size) == MR_OK);
    out.resize(size);
    return out;
}

// A causal graph, as `starts` and `near` of mr_weights and mr_graph.
struct Links {
    std::vector<int64_t> starts{0};
    std::vector<int32_t> near;
    std::vector<double> weights;
    size_t count() const { return starts.size() - 1; }
    mr_graph view() const { return {count(), starts.data(), near.data(), weights.data()}; }
};

inline Links links_of(Input& in) {
    Links links;
    const uint32_t count = in.u16() % kMostPlaces;
    const bool is_bad = in.u8() == 255;
    for (uint32_t v = 0; v < count; ++v) {
        const uint32_t degree = v > 0 ? in.u8() % 12 : 0;
        for (uint32_t k = 0; k < degree; ++k) {
            links.near.push_back(is_bad ? in.number() : static_cast<int32_t>(v - 1 - in.u8() % v));
            links.weights.push_back(1.0 / degree);
        }
        links.starts.push_back(static_cast<int64_t>(links.near.size()));
    }
    if (is_bad && count > 0) links.starts[in.u16() % count] += in.number() % 9;
    return links;
}

inline mr_weights weights_of(std::vector<int32_t>& symbols, size_t columns, const mr_graph& graph) {
    const size_t links = static_cast<size_t>(graph.starts[graph.count]);
    return {symbols.data(), graph.count, columns, graph.starts, graph.near, links};
}

inline void put_varint(Bytes& out, uint64_t value) {
    for (; value >= 0x80; value >>= 7) out.push_back(static_cast<uint8_t>(value | 0x80));
    out.push_back(static_cast<uint8_t>(value));
}

inline void put_blob(Bytes& out, const Bytes& bytes) {
    put_varint(out, bytes.size());
    out.insert(out.end(), bytes.begin(), bytes.end());
}

// Appends a CodedField record over a graph, with `head` integers before its basis.
inline void put_field(Input& in, const mr_graph& graph, size_t width, size_t head, Bytes& out) {
    size_t columns = in.u8();
    uint8_t level = in.u8();
    if (columns != 255) columns %= width + 1;
    if (level != 255) level %= 200;
    const size_t known = columns > width ? 0 : columns;
    const size_t basis = head + known * width - known * (known > 0 ? known - 1 : 0) / 2;
    put_varint(out, columns);
    out.push_back(level);
    put_blob(out, stream_of(in, basis, encoded_integers));
    put_blob(out, stream_of(in, known * graph.count, [&](std::vector<int32_t>& symbols) {
                 Bytes made(8 * symbols.size() + 64);
                 std::vector<size_t> ends(known);
                 const mr_weights weights = weights_of(symbols, known, graph);
                 size_t size = 0;
                 if (mr_encode_field(&weights, made.data(), made.size(), &size, ends.data()) != MR_OK) size = 0;
                 made.resize(size);
                 return made;
             }));
}

inline bool are_same(const std::vector<double>& a, const std::vector<double>& b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

}  // namespace meshreel
