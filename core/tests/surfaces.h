// Spheres, and frames that meshes are pulled to.
#pragma once

#include "meshreel/tree.h"
#include "shapes.h"

inline double radius_of(const double* p) { return std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]); }

inline Shape sphere(int levels, double radius) {
    Shape shape{{1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1},
                {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5}};
    for (int level = 0; level < levels; ++level) {
        std::vector<int32_t> edges(6 * shape.face_count()), finer(12 * shape.face_count());
        size_t count = 0;
        mr_subdivide(shape.faces.data(), shape.face_count(), shape.vertices(), edges.data(), finer.data(), &count);
        for (size_t e = 0; e < count; ++e)
            for (int k = 0; k < 3; ++k)
                shape.positions.push_back(shape.positions[3 * edges[2 * e] + k] +
                                          shape.positions[3 * edges[2 * e + 1] + k]);
        shape.faces = finer;
    }
    for (size_t v = 0; v < shape.vertices(); ++v) {
        const double scale = radius / radius_of(&shape.positions[3 * v]);
        for (size_t k = 0; k < 3; ++k) shape.positions[3 * v + k] *= scale;
    }
    return shape;
}

// A closed surface around the origin whose normals point away from it, and its tree.
struct Frame {
    explicit Frame(const Shape& given) : shape(given), normals(given.positions), inside(given.vertices(), 1) {
        for (size_t v = 0; v < shape.vertices(); ++v) {
            const double size = radius_of(&shape.positions[3 * v]);
            for (size_t k = 0; k < 3; ++k) normals[3 * v + k] /= size;
        }
        const mr_mesh mesh = shape.view();
        mr_tree_create(&mesh, &tree);
    }
    Frame(const Frame&) = delete;
    ~Frame() { mr_tree_destroy(tree); }

    Shape shape;
    std::vector<double> normals;
    std::vector<uint8_t> inside;
    mr_tree* tree = nullptr;
};
