// Meshes, graphs and numbers that the tests share.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "meshreel/entropy.h"
#include "meshreel/layers.h"
#include "meshreel/status.h"

using Bytes = std::vector<uint8_t>;

struct Shape {
    std::vector<double> positions;
    std::vector<int32_t> faces;
    size_t vertices() const { return positions.size() / 3; }
    size_t face_count() const { return faces.size() / 3; }
    mr_mesh view() const { return {positions.data(), vertices(), faces.data(), face_count()}; }
};

inline Shape tetrahedron() { return {{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}}; }

// side x side vertices in steps of 1, bent by `bend` times x * y.
inline Shape sheet(int side, double bend = 0.0) {
    Shape shape;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            for (double number : {double(x), double(y), bend * x * y}) shape.positions.push_back(number);
    for (int y = 0; y + 1 < side; ++y)
        for (int x = 0; x + 1 < side; ++x)
            for (int corner : {0, 1, side, 1, side + 1, side}) shape.faces.push_back(y * side + x + corner);
    return shape;
}

// Pseudo-random whole numbers, the same everywhere.
class Noise {
public:
    explicit Noise(uint32_t seed) : state_(seed) {}
    uint32_t next() {
        state_ = state_ * 1664525u + 1013904223u;
        return state_ >> 8;
    }
    int32_t within(int32_t most) { return static_cast<int32_t>(next() % (2u * most + 1u)) - most; }

private:
    uint32_t state_;
};

// A graph in which each value is predicted by the mean of the two before it.
struct Chain {
    explicit Chain(size_t count) {
        for (size_t v = 0; v < count; ++v) {
            for (size_t k = v < 2 ? 0 : v - 2; k < v; ++k) near.push_back(static_cast<int32_t>(k));
            for (size_t k = v < 2 ? 0 : v - 2; k < v; ++k) weights.push_back(v < 2 ? 1.0 : 0.5);
            starts.push_back(static_cast<int64_t>(near.size()));
        }
    }
    mr_graph view() const { return {starts.size() - 1, starts.data(), near.data(), weights.data()}; }
    mr_weights symbols(std::vector<int32_t>& values, size_t columns) const {
        return {values.data(), starts.size() - 1, columns, starts.data(), near.data(), near.size()};
    }

    std::vector<int64_t> starts{0};
    std::vector<int32_t> near;
    std::vector<double> weights;
};

inline Bytes integers(const std::vector<int32_t>& values) {
    Bytes out(8 * values.size() + 16);
    size_t size = 0;
    mr_encode_integers(values.data(), values.size(), out.data(), out.size(), &size);
    out.resize(size);
    return out;
}

inline Bytes symbols(const Chain& chain, std::vector<int32_t> values, size_t columns) {
    Bytes out(8 * values.size() + 16);
    std::vector<size_t> ends(columns);
    size_t size = 0;
    const mr_weights weights = chain.symbols(values, columns);
    mr_encode_field(&weights, out.data(), out.size(), &size, ends.data());
    out.resize(size);
    return out;
}

// A CodedField record (FORMAT.md) with short streams.
inline Bytes coded_field(uint8_t columns, uint8_t step_level, const Bytes& basis, const Bytes& stream) {
    Bytes out{columns, step_level, static_cast<uint8_t>(basis.size())};
    out.insert(out.end(), basis.begin(), basis.end());
    out.push_back(static_cast<uint8_t>(stream.size()));
    out.insert(out.end(), stream.begin(), stream.end());
    return out;
}
