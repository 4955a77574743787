// What a chunk may cost to decode, by the bytes that it has (FORMAT.md, "What a file may cost"): beside
// src/meshreel/format/budget.py, whose numbers are in layout.gen.h. Costs are in bytes, as doubles, which do not
// overflow.
#pragma once

#include <algorithm>
#include <cmath>

#include "../src/format_error.h"
#include "../src/layout.gen.h"
#include "mesh.h"

namespace meshreel {
inline double count_of(size_t number) { return static_cast<double>(number); }

// Faces and vertices of a mesh, at most, after its midpoint subdivisions.
inline double elements_of(const Mesh& mesh, unsigned levels = 0) {
    return std::ldexp(count_of(mesh.face_count() + mesh.vertex_count()), 2 * static_cast<int>(levels));
}

inline double allowance(double size) { return limits::kFree + limits::kPerByte * size; }

inline void check_cost(double cost, size_t size) {
    require(cost <= allowance(count_of(size)), "bytes that cost more to decode than so many may");
}

inline void check_growth(const Mesh& mesh, unsigned levels, size_t frames = 1) {
    const double faces = std::ldexp(count_of(mesh.face_count()), 2 * static_cast<int>(levels));
    require(count_of(frames) * std::max(faces, count_of(mesh.vertex_count())) <= limits::kFaces,
            "over 64 million faces or vertices");
}

inline void check_step(double step) { require(step > 0, "a lattice whose spacing is not above 0"); }

inline double layers_cost(const Mesh& base, unsigned levels, double frames) {
    const double products = std::floor(elements_of(base) * frames * frames / 4);
    return elements_of(base, levels) * (limits::kMoving * frames + limits::kElement) + products;
}

inline double laplacian_cost(const Mesh& reference, unsigned levels, double frames, double components) {
    std::vector<double> corners(reference.vertex_count());
    for (const int32_t v : *reference.faces) corners[static_cast<size_t>(v)] += 1;
    double pairs = 0;
    for (const double count : corners) pairs += count * count;
    const double numbers = 3 * frames * (1 + components);
    const double growing = limits::kColumn * (frames + components) + limits::kSolved + std::floor(numbers / 12);
    return elements_of(reference, levels) * growing + limits::kPair * pairs + limits::kNumber * numbers +
           limits::kFrame * frames;
}

inline double change_cost(const Mesh& before, const Mesh& added) {
    return limits::kElement * (elements_of(before) + elements_of(added));
}

}  // namespace meshreel
