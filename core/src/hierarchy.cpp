#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "arrays.h"
#include "guarded.h"
#include "meshreel/layers.h"
#include "scratch.h"

struct mr_hierarchy {
    std::vector<int32_t> order;
    std::vector<int64_t> starts{0};
    std::vector<int32_t> near;
    std::vector<double> weights;
};

namespace meshreel {
namespace {

constexpr int64_t kMostNear = 24;   // a vertex with more neighbours stays: what is left costs no more than linear time
constexpr size_t kLeastShare = 16;  // a round that removes less than this part of the linked vertices is the last
constexpr double kSlope = 0.2;      // how far slopes are drawn to zero (guess)
constexpr double kBlunt = 0.1;      // of the mean squared distance: bounds the pull of a near vertex (guess)

struct Removal {
    int32_t vertex;
    size_t begin, end;  // of its ring
};

struct Link {
    int32_t from, to;
};

// Both directions of each edge, sorted by `from`, then by `to`, none twice.
struct Adjacency {
    Array<Link> links;
    Array<size_t> starts;  // where each vertex's begin

    // Sorts links that are in any order: by counting, so that no mesh takes more than linear time.
    void sort(size_t vertices) {
        spare_.resize(links.size());
        const auto place = [&](const Array<Link>& in, Array<Link>& out, int32_t Link::* key) {
            starts.assign(vertices + 1, 0);
            for (const Link& link : in) ++starts[static_cast<size_t>(link.*key)];
            size_t sum = 0;
            for (size_t& start : starts) {
                const size_t count = start;
                start = sum;
                sum += count;
            }
            for (const Link& link : in) out[starts[static_cast<size_t>(link.*key)]++] = link;
        };
        place(links, spare_, &Link::to);
        place(spare_, links, &Link::from);
        size_t kept = 0;
        starts.assign(vertices + 1, 0);
        for (const Link& link : links) {
            if (kept > 0 && links[kept - 1].from == link.from && links[kept - 1].to == link.to) continue;
            links[kept++] = link;
            ++starts[static_cast<size_t>(link.from) + 1];
        }
        links.resize(kept);
        for (size_t v = 0; v < vertices; ++v) starts[v + 1] += starts[v];
    }

private:
    Array<Link> spare_;
};

double squared_distance(const double* a, const double* b) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

// Weights that predict a smooth function at p from its values at the ring: the constant term of a local affine
// regression, nearer vertices weighing more, slopes drawn to zero. They sum to one.
void regression(const double* positions, int32_t v, const int32_t* ring, size_t count, double* w) {
    const double* p = positions + 3 * static_cast<size_t>(v);
    const auto place = [&](size_t j) { return positions + 3 * static_cast<size_t>(ring[j]); };
    double spread = 0.0;
    for (size_t j = 0; j < count; ++j) spread += squared_distance(place(j), p);
    const double blunt = kBlunt * (spread / static_cast<double>(count));
    double total = 0.0, energy = 0.0, s[3] = {0.0, 0.0, 0.0}, m[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    for (size_t j = 0; j < count; ++j) {
        const double* r = place(j);
        const double x = r[0] - p[0], y = r[1] - p[1], z = r[2] - p[2];
        const double far = x * x + y * y + z * z;
        const double g = 1.0 / (far + blunt);
        w[j] = g;
        total += g;
        energy += g * far;
        s[0] += g * x, s[1] += g * y, s[2] += g * z;
        m[0] += g * x * x, m[1] += g * x * y, m[2] += g * x * z, m[3] += g * y * y, m[4] += g * y * z,
            m[5] += g * z * z;
    }
    const double draw = kSlope * energy;
    const double d0 = m[0] + draw, l10 = m[1] / d0, l20 = m[2] / d0;  // L D L^T
    const double d1 = (m[3] + draw) - l10 * m[1], l21 = (m[4] - l20 * m[1]) / d1;
    const double d2 = (m[5] + draw) - l20 * m[2] - l21 * l21 * d1;
    const double y0 = s[0], y1 = s[1] - l10 * y0, y2 = s[2] - l20 * y0 - l21 * y1;
    const double b2 = y2 / d2, b1 = y1 / d1 - l21 * b2, b0 = y0 / d0 - l10 * b1 - l20 * b2;
    const double alpha = 1.0 / (total - (s[0] * b0 + s[1] * b1 + s[2] * b2));
    bool good = true;
    for (size_t j = 0; j < count; ++j) {
        const double* r = place(j);
        w[j] = w[j] * alpha * (1.0 - (b0 * (r[0] - p[0]) + b1 * (r[1] - p[1]) + b2 * (r[2] - p[2])));
        good = good && std::fabs(w[j]) <= 4.0;
    }
    if (!good)
        for (size_t j = 0; j < count; ++j) w[j] = 1.0 / static_cast<double>(count);
}

// Rounds in which vertices that no neighbour's removal forbids leave, each merged into its nearest neighbour.
void remove_vertices(const double* positions, size_t vertices, Adjacency& mesh, Array<Removal>& removals,
                     Array<int32_t>& rings) {
    Array<int32_t> heir(vertices);
    for (size_t v = 0; v < vertices; ++v) heir[v] = static_cast<int32_t>(v);
    for (;;) {
        size_t linked = 0, removed = 0;
        for (size_t v = 0; v < vertices; ++v) {
            const size_t begin = mesh.starts[v], end = mesh.starts[v + 1];
            if (begin == end) continue;
            ++linked;
            if (end - begin > kMostNear) continue;
            bool stays = false;
            for (size_t k = begin; k < end && !stays; ++k)
                stays = heir[static_cast<size_t>(mesh.links[k].to)] != mesh.links[k].to;
            if (stays) continue;
            removals.push_back({static_cast<int32_t>(v), rings.size(), rings.size() + (end - begin)});
            double least = 0.0;
            for (size_t k = begin; k < end; ++k) {
                const int32_t u = mesh.links[k].to;
                const double distance = squared_distance(positions + 3 * static_cast<size_t>(u), positions + 3 * v);
                if (k == begin || distance < least) least = distance, heir[v] = u;
                rings.push_back(u);
            }
            ++removed;
        }
        if (removed == 0) return;
        size_t kept = 0;
        for (const Link& old : mesh.links) {
            const Link link{heir[static_cast<size_t>(old.from)], heir[static_cast<size_t>(old.to)]};
            if (link.from != link.to) mesh.links[kept++] = link;
        }
        mesh.links.resize(kept);
        mesh.sort(vertices);
        if (removed * kLeastShare < linked) return;
    }
}

void build(const double* positions, size_t vertices, const int32_t* faces, size_t face_count, mr_hierarchy& out) {
    Adjacency mesh;
    mesh.links.reserve(6 * face_count);
    for (size_t f = 0; f < face_count; ++f)
        for (int c = 0; c < 3; ++c) {
            const int32_t a = faces[3 * f + static_cast<size_t>(c)],
                          b = faces[3 * f + static_cast<size_t>((c + 1) % 3)];
            if (a != b) mesh.links.push_back({a, b}), mesh.links.push_back({b, a});
        }
    mesh.sort(vertices);
    Array<Removal> removals;
    Array<int32_t> rings;
    remove_vertices(positions, vertices, mesh, removals, rings);
    Array<int32_t> place(vertices, 0);
    for (const Removal& removal : removals) place[static_cast<size_t>(removal.vertex)] = -1;
    for (size_t v = 0; v < vertices; ++v) {
        if (place[v] < 0) continue;  // a root: the one before it predicts it
        const int32_t at = static_cast<int32_t>(out.order.size());
        place[v] = at;
        out.order.push_back(static_cast<int32_t>(v));
        if (at > 0) out.near.push_back(at - 1), out.weights.push_back(1.0);
        out.starts.push_back(static_cast<int64_t>(out.near.size()));
    }
    double w[kMostNear];
    for (auto removal = removals.rbegin(); removal != removals.rend(); ++removal) {
        const size_t count = removal->end - removal->begin;
        regression(positions, removal->vertex, &rings[removal->begin], count, w);
        place[static_cast<size_t>(removal->vertex)] = static_cast<int32_t>(out.order.size());
        out.order.push_back(removal->vertex);
        for (size_t j = 0; j < count; ++j) {
            out.near.push_back(place[static_cast<size_t>(rings[removal->begin + j])]);
            out.weights.push_back(w[j]);
        }
        out.starts.push_back(static_cast<int64_t>(out.near.size()));
    }
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_hierarchy_create(const mr_mesh* mesh, mr_hierarchy** out) {
    if (mesh->vertices > INT32_MAX) return MR_BAD_INPUT;
    if (!in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        auto made = std::make_unique<mr_hierarchy>();
        build(mesh->positions, mesh->vertices, mesh->faces, mesh->face_count, *made);
        *out = made.release();
        return int{MR_OK};
    });
}

void mr_hierarchy_destroy(mr_hierarchy* hierarchy) { delete hierarchy; }

const int32_t* mr_hierarchy_order(const mr_hierarchy* hierarchy) { return hierarchy->order.data(); }

mr_graph mr_hierarchy_graph(const mr_hierarchy* hierarchy) {
    return {hierarchy->order.size(), hierarchy->starts.data(), hierarchy->near.data(), hierarchy->weights.data()};
}
