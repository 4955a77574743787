// Triangle meshes as they are decoded, and what decoding does with them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "meshreel/layers.h"
#include "meshreel/status.h"

namespace meshreel {

using Faces = std::shared_ptr<const std::vector<int32_t>>;  // three vertices of each; never null

Faces no_faces();

struct Mesh {
    std::vector<double> vertices;  // x, y, z of each
    Faces faces = no_faces();
    std::vector<uint8_t> colors;  // red, green and blue of each vertex, sRGB; empty without colours
    std::vector<float> places;    // two of each corner of each face, in a texture; empty without

    size_t vertex_count() const { return vertices.size() / 3; }
    size_t face_count() const { return faces->size() / 3; }
    mr_mesh view() const { return {vertices.data(), vertex_count(), faces->data(), face_count()}; }
};

// One midpoint subdivision, which all frames of a group and those predicted from it share.
struct Connectivity {
    size_t vertices;             // of the coarser mesh
    std::vector<int32_t> edges;  // two vertices of each; edge e has vertex `vertices` + e in its middle
    Faces faces;                 // of the finer mesh
    std::vector<int64_t> starts;
    std::vector<int32_t> near;  // the siblings of edge e are near[starts[e] .. starts[e + 1])

    size_t edge_count() const { return edges.size() / 2; }
    size_t count() const { return vertices + edge_count(); }  // vertices of the finer mesh
};

// Without siblings unless they are asked for. Throws FormatError for a face that names none of the vertices.
Connectivity subdivide(const Faces& faces, size_t vertices, bool with_siblings);

// The mesh with each triangle cut in four at the middles of its edges, `levels` times.
Mesh subdivide_midpoint(const Mesh& mesh, unsigned levels);

// Moves each coordinate to origin + scale * coordinate.
void place_all(const mr_placement& placement, double* vertices, size_t numbers);
inline void place_all(const mr_placement& placement, std::vector<double>& vertices) {
    place_all(placement, vertices.data(), vertices.size());
}

// Turns vertices about an origin by a rotation matrix, row by row.
void turn_all(const double (&rotation)[9], const double* origin, double* vertices, size_t numbers);

// Drops the faces of which `dropped` is 1, and the vertices that no other face names.
Mesh without(const Mesh& mesh, const std::vector<uint8_t>& dropped);

// Puts a mesh behind another; where one of them has colours, vertices of the other are grey. Where the first has
// places, corners of the other have none.
void append(Mesh& mesh, const Mesh& other);

// The bits that runs give in turn, not set and set, from the `used`-th run on, which is moved behind them.
std::vector<uint8_t> fill_runs(const std::vector<int32_t>& runs, size_t count, size_t& used);

}  // namespace meshreel
