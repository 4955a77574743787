// Equal rows (positions, faces) are found in buckets of a hash, each of which is sorted: no input takes time in
// proportion to a square. No result depends on the hash, for rows are numbered by their first appearance.
#include "meshreel/topology.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <vector>

#include "arrays.h"
#include "guarded.h"

namespace meshreel {
namespace {

template <class T>
using Row = std::array<T, 3>;

bool sound(const mr_mesh& mesh) {
    return mesh.vertices <= INT32_MAX && mesh.face_count <= INT32_MAX &&
           in_range(mesh.faces, 3 * mesh.face_count, mesh.vertices);
}

template <class T>
uint64_t hash_of(const Row<T>& key) {
    uint64_t hash = 0;
    for (const T part : key) {
        hash = (hash ^ static_cast<uint64_t>(part)) * 0x9e3779b97f4a7c15;  // 2^64 / golden ratio, as Knuth hashes
        hash ^= hash >> 32;
    }
    return hash;
}

// For each of `count` rows the first that is the same. Rows of different keys are not the same.
template <class Key, class Same>
std::vector<int32_t> first_of_same(size_t count, Key key, Same same) {
    size_t mask = 1;
    while (mask < count) mask *= 2;
    mask -= 1;
    std::vector<int32_t> bounds(mask + 2, 0), rows(count), first(count), buckets(count);
    for (size_t row = 0; row < count; ++row) {
        buckets[row] = static_cast<int32_t>(hash_of(key(row)) & mask);
        ++bounds[static_cast<size_t>(buckets[row]) + 1];
    }
    std::partial_sum(bounds.begin(), bounds.end(), bounds.begin());
    for (size_t row = count; row-- > 0;)  // backwards: bounds sink from the ends of the buckets to their beginnings
        rows[static_cast<size_t>(--bounds[static_cast<size_t>(buckets[row]) + 1])] = static_cast<int32_t>(row);
    for (size_t at = 0; at <= mask; ++at) {
        const auto begin = rows.begin() + bounds[at + 1], end = at < mask ? rows.begin() + bounds[at + 2] : rows.end();
        if (end - begin > 1)
            std::sort(begin, end, [&](int32_t a, int32_t b) {
                const auto left = key(static_cast<size_t>(a)), right = key(static_cast<size_t>(b));
                return left != right ? left < right : a < b;
            });
        int32_t last = -1;
        for (auto row = begin; row != end; ++row) {
            if (last < 0 || !same(static_cast<size_t>(last), static_cast<size_t>(*row))) last = *row;
            first[static_cast<size_t>(*row)] = last;
        }
    }
    return first;
}

std::vector<int32_t> first_at_position(const mr_mesh& mesh) {
    const auto key = [&](size_t v) {
        Row<uint64_t> bits;
        for (size_t k = 0; k < 3; ++k) {
            const double x = mesh.positions[3 * v + k] + 0.0;  // -0 becomes 0
            std::memcpy(&bits[k], &x, sizeof x);
        }
        return bits;
    };
    return first_of_same(mesh.vertices, key, [&](size_t a, size_t b) {
        const double *p = mesh.positions + 3 * a, *q = mesh.positions + 3 * b;
        return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
    });
}

std::vector<int32_t> first_with_vertices(std::vector<Row<int32_t>> faces) {
    for (Row<int32_t>& corners : faces) {
        if (corners[0] > corners[1]) std::swap(corners[0], corners[1]);
        if (corners[1] > corners[2]) std::swap(corners[1], corners[2]);
        if (corners[0] > corners[1]) std::swap(corners[0], corners[1]);
    }
    return first_of_same(
        faces.size(), [&](size_t f) { return faces[f]; }, [&](size_t a, size_t b) { return faces[a] == faces[b]; });
}

bool collapsed(const Row<int32_t>& face) { return face[0] == face[1] || face[1] == face[2] || face[2] == face[0]; }

Row<int32_t> face_of(const mr_mesh& mesh, size_t f) {
    return {mesh.faces[3 * f], mesh.faces[3 * f + 1], mesh.faces[3 * f + 2]};
}

// The cross product of two sides of a face, and the square of its length.
struct Span {
    Row<double> normal;
    double square;

    double length() const { return std::sqrt(square); }
};

Span span_of(const mr_mesh& mesh, const Row<int32_t>& face) {
    const double *a = mesh.positions + 3 * face[0], *b = mesh.positions + 3 * face[1],
                 *c = mesh.positions + 3 * face[2];
    const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
    const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
    const double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    return {{x, y, z}, x * x + y * y + z * z};
}

Row<double> unit(const Span& span) {
    const double divisor = span.square > 0 ? span.length() : 1.0;
    return {span.normal[0] / divisor, span.normal[1] / divisor, span.normal[2] / divisor};
}

void put(const Row<int32_t>& face, size_t origin, mr_rest& rest) {
    if (rest.face_origins) rest.face_origins[rest.face_count] = static_cast<int32_t>(origin);
    std::copy_n(face.data(), 3, rest.faces + 3 * rest.face_count++);
}

// Puts a vertex; returns its number.
int32_t put_vertex(const mr_mesh& mesh, size_t v, mr_rest& rest) {
    std::copy_n(mesh.positions + 3 * v, 3, rest.positions + 3 * rest.vertices);
    if (rest.vertex_origins) rest.vertex_origins[rest.vertices] = static_cast<int32_t>(v);
    return static_cast<int32_t>(rest.vertices++);
}

void weld(const mr_mesh& mesh, mr_rest& rest) {
    const std::vector<int32_t> first = first_at_position(mesh);
    std::vector<int32_t> numbers(mesh.vertices);
    rest.vertices = rest.face_count = 0;
    for (size_t v = 0; v < mesh.vertices; ++v) {
        if (const size_t at = static_cast<size_t>(first[v]); at < v) {
            numbers[v] = numbers[at];
            continue;
        }
        numbers[v] = put_vertex(mesh, v, rest);
    }
    for (size_t f = 0; f < mesh.face_count; ++f) {
        Row<int32_t> face = face_of(mesh, f);
        for (int32_t& corner : face) corner = numbers[static_cast<size_t>(corner)];
        if (!collapsed(face)) put(face, f, rest);
    }
}

// Moves to `rest` the vertices that its faces, still in the numbers of the mesh, use.
void move_used(const mr_mesh& mesh, mr_rest& rest) {
    std::vector<int32_t> numbers(mesh.vertices, 0);
    for (size_t k = 0; k < 3 * rest.face_count; ++k) numbers[static_cast<size_t>(rest.faces[k])] = 1;
    rest.vertices = 0;
    for (size_t v = 0; v < mesh.vertices; ++v) {
        if (numbers[v] != 0) numbers[v] = put_vertex(mesh, v, rest);
    }
    for (size_t k = 0; k < 3 * rest.face_count; ++k) rest.faces[k] = numbers[static_cast<size_t>(rest.faces[k])];
}

void clean(const mr_mesh& mesh, mr_rest& rest) {
    std::vector<Row<int32_t>> faces;
    std::vector<size_t> origins;
    faces.reserve(mesh.face_count);
    origins.reserve(mesh.face_count);
    for (size_t f = 0; f < mesh.face_count; ++f) {
        const Row<int32_t> face = face_of(mesh, f);
        if (collapsed(face) || !(span_of(mesh, face).square > 0)) continue;
        faces.push_back(face);
        origins.push_back(f);
    }
    const std::vector<int32_t> first = first_with_vertices(faces);
    rest.face_count = 0;
    for (size_t f = 0; f < faces.size(); ++f)
        if (static_cast<size_t>(first[f]) == f) put(faces[f], origins[f], rest);
    move_used(mesh, rest);
}

// Labels vertices by the trees that faces join; each tree's root is its first vertex.
void label(const int32_t* faces, size_t face_count, size_t vertices, int32_t* labels) {
    std::iota(labels, labels + vertices, 0);
    const auto root = [&](int32_t corner) {
        for (; labels[corner] != corner; corner = labels[corner]) labels[corner] = labels[labels[corner]];
        return corner;
    };
    for (size_t f = 0; f < face_count; ++f)
        for (size_t k = 1; k < 3; ++k) {
            const int32_t a = root(faces[3 * f]), b = root(faces[3 * f + k]);
            labels[std::max(a, b)] = std::min(a, b);
        }
    int32_t count = 0;
    for (size_t v = 0; v < vertices; ++v) {  // what a label refers to is before it, and has its number already
        const size_t before = static_cast<size_t>(labels[v]);
        labels[v] = before == v ? count++ : labels[before];
    }
}

void normals_of_vertices(const mr_mesh& mesh, double* normals) {
    std::vector<Row<double>> weighted(mesh.face_count);
    for (size_t f = 0; f < mesh.face_count; ++f) {
        const Span span = span_of(mesh, face_of(mesh, f));
        weighted[f] = unit(span);
        for (double& part : weighted[f]) part *= span.length() / 2;
    }
    std::fill_n(normals, 3 * mesh.vertices, 0.0);
    std::vector<double> sums(3 * mesh.vertices);
    for (size_t corner = 0; corner < 3; ++corner) {
        std::fill(sums.begin(), sums.end(), 0.0);
        for (size_t f = 0; f < mesh.face_count; ++f)
            for (size_t k = 0; k < 3; ++k)
                sums[3 * static_cast<size_t>(mesh.faces[3 * f + corner]) + k] += weighted[f][k];
        for (size_t k = 0; k < sums.size(); ++k) normals[k] += sums[k];
    }
    for (double* at = normals; at != normals + 3 * mesh.vertices; at += 3) {
        const double length = std::sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
        const double divisor = length > 0 ? length : 1.0;
        for (size_t k = 0; k < 3; ++k) at[k] /= divisor;
    }
}

double longest_side(const mr_mesh& mesh, const Row<int32_t>& face) {
    double most = 0;
    for (size_t k = 0; k < 3; ++k) {
        const double *a = mesh.positions + 3 * face[k], *b = mesh.positions + 3 * face[(k + 1) % 3];
        const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
        most = std::max(most, (x * x + y * y) + z * z);
    }
    return std::sqrt(most);
}

// Barycentric middles of the count^2 equal parts of a face: those that point as it does, then the others.
std::vector<Row<double>> middles_of_parts(int32_t count) {
    std::vector<Row<double>> middles;
    for (const int32_t turned : {0, 1})
        for (int32_t row = 0; row < count - turned; ++row)
            for (int32_t column = 0; row + column < count - turned; ++column) {
                const double aside = turned == 0 ? 1.0 / 3 : 2.0 / 3;
                const double first = (row + aside) / count, second = (column + aside) / count;
                middles.push_back({1 - first - second, first, second});
            }
    return middles;
}

void spread(const mr_mesh& mesh, const int32_t* parts, double* points, int64_t* faces) {
    std::vector<std::vector<Row<double>>> known;
    for (size_t f = 0; f < mesh.face_count; ++f) {
        const size_t count = static_cast<size_t>(parts[f]);
        if (known.size() <= count) known.resize(count + 1);
        if (known[count].empty()) known[count] = middles_of_parts(parts[f]);
        const Row<int32_t> face = face_of(mesh, f);
        const double *a = mesh.positions + 3 * face[0], *b = mesh.positions + 3 * face[1],
                     *c = mesh.positions + 3 * face[2];
        for (const Row<double>& weights : known[count]) {
            for (size_t k = 0; k < 3; ++k) *points++ = (weights[0] * a[k] + weights[1] * b[k]) + weights[2] * c[k];
            *faces++ = static_cast<int64_t>(f);
        }
    }
}

template <class Body>
int checked(const mr_mesh& mesh, Body body) {
    if (!sound(mesh)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        body();
        return int{MR_OK};
    });
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_weld(const mr_mesh* mesh, mr_rest* rest) {
    return checked(*mesh, [&] { weld(*mesh, *rest); });
}

int mr_clean(const mr_mesh* mesh, mr_rest* rest) {
    return checked(*mesh, [&] { clean(*mesh, *rest); });
}

int mr_drop_unreferenced(const mr_mesh* mesh, mr_rest* rest) {
    return checked(*mesh, [&] {
        rest->face_count = mesh->face_count;
        std::copy_n(mesh->faces, 3 * mesh->face_count, rest->faces);
        if (rest->face_origins) std::iota(rest->face_origins, rest->face_origins + mesh->face_count, 0);
        move_used(*mesh, *rest);
    });
}

int mr_components(const int32_t* faces, size_t face_count, size_t vertices, int32_t* labels) {
    return checked({nullptr, vertices, faces, face_count}, [&] { label(faces, face_count, vertices, labels); });
}

int mr_face_normals(const mr_mesh* mesh, double* normals, double* areas) {
    return checked(*mesh, [&] {
        for (size_t f = 0; f < mesh->face_count; ++f) {
            const Span span = span_of(*mesh, face_of(*mesh, f));
            const Row<double> normal = unit(span);
            std::copy_n(normal.data(), 3, normals + 3 * f);
            areas[f] = span.length() / 2;
        }
    });
}

int mr_vertex_normals(const mr_mesh* mesh, double* normals) {
    return checked(*mesh, [&] { normals_of_vertices(*mesh, normals); });
}

int mr_blend(const mr_mesh* mesh, const double* weights, double* points) {
    return checked(*mesh, [&] {
        for (size_t f = 0; f < mesh->face_count; ++f) {
            const int32_t* corners = mesh->faces + 3 * f;
            const double *a = mesh->positions + 3 * size_t(corners[0]), *b = mesh->positions + 3 * size_t(corners[1]),
                         *c = mesh->positions + 3 * size_t(corners[2]), *w = weights ? weights + 3 * f : nullptr;
            for (size_t d = 0; d < 3; ++d)
                points[3 * f + d] = w ? w[0] * a[d] + w[1] * b[d] + w[2] * c[d] : (a[d] + b[d] + c[d]) / 3.0;
        }
    });
}

int mr_spread_parts(const mr_mesh* mesh, double spacing, int32_t most, int32_t* parts, size_t* count) {
    if (!(spacing > 0) || most < 1) return MR_BAD_INPUT;
    return checked(*mesh, [&] {
        *count = 0;
        for (size_t f = 0; f < mesh->face_count; ++f) {
            const double wanted = std::ceil(longest_side(*mesh, face_of(*mesh, f)) / spacing);
            parts[f] = wanted < most ? static_cast<int32_t>(std::max(wanted, 1.0)) : most;
            *count += static_cast<size_t>(parts[f]) * static_cast<size_t>(parts[f]);
        }
    });
}

int mr_spread(const mr_mesh* mesh, const int32_t* parts, double* points, int64_t* faces) {
    return checked(*mesh, [&] { spread(*mesh, parts, points, faces); });
}
