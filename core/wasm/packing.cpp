#include "packing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "../src/arrays.h"

namespace meshreel {
namespace {

constexpr double kMostPlace = 65535.0, kHalfNormal = 127.5;

uint16_t place_of(double x, double low, double high) {
    const double width = high - low;
    const double share = width > 0.0 ? (x - low) / width : 0.0;
    const double within = share > 0.0 ? std::min(share, 1.0) : 0.0;  // not a number where the width overflows
    return static_cast<uint16_t>(std::floor(within * kMostPlace + 0.5));
}

uint16_t byte_of(double x) { return static_cast<uint16_t>(std::floor((x + 1.0) * kHalfNormal + 0.5)); }

// The sphere onto the octahedron |x| + |y| + |z| = 1, its lower half folded outwards, onto a square.
uint16_t octahedral(const double* n) {
    const double sum = std::fabs(n[0]) + std::fabs(n[1]) + std::fabs(n[2]);
    if (!(sum > 0.0 && std::isfinite(sum))) return static_cast<uint16_t>(byte_of(0.0) | byte_of(0.0) << 8);
    double u = n[0] / sum, v = n[1] / sum;
    if (n[2] < 0.0) {
        const double folded = (1.0 - std::fabs(v)) * (u < 0.0 ? -1.0 : 1.0);
        v = (1.0 - std::fabs(u)) * (v < 0.0 ? -1.0 : 1.0);
        u = folded;
    }
    return static_cast<uint16_t>(byte_of(u) | byte_of(v) << 8);
}

// The area-weighted sum of the normals of the faces at each vertex, not of unit length.
std::vector<double> normal_sums(const mr_mesh& mesh) {
    std::vector<double> sums(3 * mesh.vertices, 0.0);
    for (size_t f = 0; f < mesh.face_count; ++f) {
        const int32_t* face = mesh.faces + 3 * f;
        const double *a = mesh.positions + 3 * face[0], *b = mesh.positions + 3 * face[1],
                     *c = mesh.positions + 3 * face[2];
        const double u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, w[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
        const double n[3] = {u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]};
        for (size_t corner = 0; corner < 3; ++corner)
            for (size_t k = 0; k < 3; ++k) sums[3 * face[corner] + k] += n[k];
    }
    return sums;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

void mr_grow_box(const double* positions, size_t vertices, double box[6]) {
    for (size_t v = 0; v < vertices; ++v)
        for (size_t k = 0; k < 3; ++k) {
            box[k] = std::min(box[k], positions[3 * v + k]);
            box[3 + k] = std::max(box[3 + k], positions[3 * v + k]);
        }
}

int mr_pack_vertices(const mr_mesh* mesh, const double box[6], uint16_t* texels) {
    if (!in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices)) return MR_BAD_INPUT;
    const std::vector<double> sums = normal_sums(*mesh);
    for (size_t v = 0; v < mesh->vertices; ++v) {
        for (size_t k = 0; k < 3; ++k) texels[4 * v + k] = place_of(mesh->positions[3 * v + k], box[k], box[3 + k]);
        texels[4 * v + 3] = octahedral(sums.data() + 3 * v);
    }
    return MR_OK;
}
