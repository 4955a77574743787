#include "mesh.h"

#include <limits>

#include "../src/format_error.h"

namespace meshreel {
namespace {

constexpr uint8_t kGrey = 128;  // of vertices without colours beside some with colours

}  // namespace

Faces no_faces() { return std::make_shared<const std::vector<int32_t>>(); }

Connectivity subdivide(const Faces& faces, size_t vertices, bool with_siblings) {
    const size_t count = faces->size() / 3;
    Connectivity made;
    made.vertices = vertices;
    made.edges.resize(6 * count);
    std::vector<int32_t> finer(12 * count);
    size_t edges = 0;
    check(mr_subdivide(faces->data(), count, vertices, made.edges.data(), finer.data(), &edges));
    made.edges.resize(2 * edges);
    made.edges.shrink_to_fit();
    if (with_siblings) {
        made.starts.resize(edges + 1);
        made.near.resize(3 * count);
        check(mr_siblings(finer.data(), count, vertices, edges, made.starts.data(), made.near.data()));
        made.near.resize(static_cast<size_t>(made.starts[edges]));
        made.near.shrink_to_fit();
    }
    made.faces = std::make_shared<const std::vector<int32_t>>(std::move(finer));
    return made;
}

Mesh subdivide_midpoint(const Mesh& mesh, unsigned levels) {
    Mesh finer = mesh;
    for (unsigned level = 0; level < levels; ++level) {
        const Connectivity cut = subdivide(finer.faces, finer.vertex_count(), false);
        finer.vertices.reserve(3 * cut.count());
        for (size_t e = 0; e < cut.edge_count(); ++e) {
            const size_t a = 3 * static_cast<size_t>(cut.edges[2 * e]),
                         b = 3 * static_cast<size_t>(cut.edges[2 * e + 1]);
            for (size_t k = 0; k < 3; ++k)
                finer.vertices.push_back((finer.vertices[a + k] + finer.vertices[b + k]) / 2);
        }
        finer.faces = cut.faces;
    }
    return finer;
}

void place_all(const mr_placement& placement, double* vertices, size_t numbers) {
    for (size_t k = 0; k < numbers; ++k) vertices[k] = placement.origin[k % 3] + placement.scale * vertices[k];
}

void turn_all(const double (&rotation)[9], const double* origin, double* vertices, size_t numbers) {
    for (size_t v = 0; v < numbers; v += 3) {
        double* at = vertices + v;
        const double x = at[0] - origin[0], y = at[1] - origin[1], z = at[2] - origin[2];
        for (size_t k = 0; k < 3; ++k) {
            const double* row = rotation + 3 * k;
            at[k] = origin[k] + (row[0] * x + row[1] * y + row[2] * z);
        }
    }
}

Mesh without(const Mesh& mesh, const std::vector<uint8_t>& dropped) {
    std::vector<int32_t> kept, place(mesh.vertex_count(), -1);
    Mesh rest;
    for (size_t f = 0; f < dropped.size(); ++f) {
        if (dropped[f]) continue;
        kept.insert(kept.end(), mesh.faces->begin() + 3 * f, mesh.faces->begin() + 3 * f + 3);
        if (!mesh.places.empty())
            rest.places.insert(rest.places.end(), mesh.places.begin() + 6 * f, mesh.places.begin() + 6 * f + 6);
    }
    for (const int32_t v : kept) place[v] = 0;
    for (size_t v = 0; v < place.size(); ++v) {
        if (place[v] < 0) continue;
        place[v] = static_cast<int32_t>(rest.vertex_count());
        rest.vertices.insert(rest.vertices.end(), mesh.vertices.begin() + 3 * v, mesh.vertices.begin() + 3 * v + 3);
        if (!mesh.colors.empty())
            rest.colors.insert(rest.colors.end(), mesh.colors.begin() + 3 * v, mesh.colors.begin() + 3 * v + 3);
    }
    for (int32_t& v : kept) v = place[v];
    rest.faces = std::make_shared<const std::vector<int32_t>>(std::move(kept));
    return rest;
}

void append(Mesh& mesh, const Mesh& other) {
    if (other.vertices.empty()) return;
    if (mesh.vertices.empty()) {
        mesh = other;
        return;
    }
    const size_t vertices = mesh.vertices.size() + other.vertices.size();
    if (!mesh.colors.empty() || !other.colors.empty()) {
        mesh.colors.resize(mesh.vertices.size(), kGrey);
        mesh.colors.insert(mesh.colors.end(), other.colors.begin(), other.colors.end());
        mesh.colors.resize(vertices, kGrey);
    }
    const size_t corners = mesh.faces->size() + other.faces->size();
    if (!mesh.places.empty()) mesh.places.resize(2 * corners, std::numeric_limits<float>::quiet_NaN());
    std::vector<int32_t> faces;
    faces.reserve(corners);
    faces.insert(faces.end(), mesh.faces->begin(), mesh.faces->end());
    const int32_t first = static_cast<int32_t>(mesh.vertex_count());
    for (const int32_t v : *other.faces) faces.push_back(v + first);
    mesh.faces = std::make_shared<const std::vector<int32_t>>(std::move(faces));
    mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
}

std::vector<uint8_t> fill_runs(const std::vector<int32_t>& runs, size_t count, size_t& used) {
    std::vector<uint8_t> bits;
    bits.reserve(count);
    for (size_t k = used; k < runs.size(); ++k) {
        const bool is_first = k == used, is_set = (k - used) % 2 == 1;
        require(runs[k] >= (is_first ? 0 : 1), "runs of faces: one without length");
        const size_t length = static_cast<size_t>(runs[k]);
        if (length > count - bits.size()) break;
        bits.insert(bits.end(), length, is_set);
        if (bits.size() < count) continue;
        used = k + 1;
        return bits;
    }
    throw FormatError("runs of faces that do not end with the faces they describe");
}

}  // namespace meshreel
