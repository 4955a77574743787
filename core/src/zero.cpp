// Marching cubes (Lorensen and Cline 1987) over blocks of voxels. On a face of a cube with two inside corners that are
// not neighbours, these are apart: cubes on both sides see the same, so that no holes come up.
#include <algorithm>
#include <array>
#include <bitset>
#include <vector>

#include "guarded.h"
#include "meshreel/voxels.h"

namespace meshreel {
namespace {

constexpr int kSide = MR_BLOCK_SIDE, kWide = kSide + 1;  // with the first voxels of the blocks that follow
constexpr int kVoxels = MR_BLOCK_VOXELS;
constexpr int kEdges = 3 * kVoxels, kWords = kEdges / 64;  // of a block: one along each axis from each voxel

using Block = std::array<int32_t, 3>;

struct Edge {
    int corner, axis;  // from a corner, whose bits are its coordinates, along an axis
};

// The triangles of a cube with given inside corners, three edges each.
using Triangles = std::vector<std::array<Edge, 3>>;

class Cases {
public:
    Cases() {
        for (int inside = 0; inside < 256; ++inside) triangles_[static_cast<size_t>(inside)] = triangulate(inside);
    }
    const Triangles& operator[](int inside) const { return triangles_[static_cast<size_t>(inside)]; }

private:
    static int number(int a, int b) { return 8 * ((a ^ b) >> 1) + std::min(a, b); }  // of the edge between two corners
    static Edge edge(int number) { return {number % 8, number / 8}; }

    static bool share_face(Edge a, Edge b) {
        const int every = a.corner & b.corner, some = a.corner | b.corner | 1 << a.axis | 1 << b.axis;
        return every != 0 || some != 7;
    }

    // The corner of a loop whose diagonals lie in no face of the cube, where the next cube may have the same ones.
    static size_t apex_of(const std::vector<int>& loop) {
        const size_t count = loop.size();
        for (size_t apex = 0; apex < count; ++apex) {
            bool inner = true;
            for (size_t k = 2; k + 1 < count; ++k)
                inner = inner && !share_face(edge(loop[apex]), edge(loop[(apex + k) % count]));
            if (inner) return apex;
        }
        return 0;
    }

    // Each face of the cube leads from where the surface goes in to where it comes out; the ways join to loops.
    static Triangles triangulate(int inside) {
        int next[24];
        std::fill(next, next + 24, -1);
        for (int axis = 0; axis < 3; ++axis)
            for (int high = 0; high < 2; ++high) {
                const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, at = high << axis;
                int around[4] = {at, at + u, at + u + v, at + v};  // counterclockwise, seen from outside
                if (high == 0) std::swap(around[1], around[3]);
                for (int k = 0; k < 4; ++k) {
                    const int before = around[(k + 3) % 4];
                    if (!(inside >> around[k] & 1) || (inside >> before & 1)) continue;
                    int last = k;
                    while (inside >> around[(last + 1) % 4] & 1) ++last;
                    next[number(before, around[k])] = number(around[last % 4], around[(last + 1) % 4]);
                }
            }
        Triangles triangles;
        for (int first = 0; first < 24; ++first) {
            std::vector<int> loop;
            for (int at = first; next[at] >= 0;) {
                loop.push_back(at);
                const int after = next[at];
                next[at] = -1;
                at = after;
            }
            const size_t count = loop.size(), apex = apex_of(loop);
            for (size_t k = 1; k + 1 < count; ++k)
                triangles.push_back(
                    {edge(loop[apex]), edge(loop[(apex + k) % count]), edge(loop[(apex + k + 1) % count])});
        }
        return triangles;
    }

    std::array<Triangles, 256> triangles_;
};

class Zero {
public:
    Zero(const mr_blocks& of, float least) : of_(of), least_(least), crossed_(of.count), mixed_(of.count) {
        for (size_t n = 0; n < of.count; ++n) cross(n);
        for (size_t n = 0; n < of.count; ++n)
            if (mixed_[n]) polygonize(n);
    }

    std::vector<std::array<double, 3>> vertices;
    std::vector<std::array<int32_t, 3>> faces;

private:
    struct Crossed {
        std::array<std::bitset<64>, kWords> edges;
        std::array<int32_t, kWords> first;  // vertex of each word
    };
    struct Around {
        size_t block[8];  // this one and those that follow along axes, by the bits of the number; `count`: none
    };

    static int place(int x, int y, int z) { return (z * kWide + y) * kWide + x; }
    static int voxel(int x, int y, int z) { return (z * kSide + y) * kSide + x; }

    Block block(size_t n) const { return {of_.blocks[3 * n], of_.blocks[3 * n + 1], of_.blocks[3 * n + 2]}; }

    size_t find(const Block& wanted) const {
        size_t low = 0, high = of_.count;
        while (low < high) {
            const size_t middle = low + (high - low) / 2;
            if (block(middle) < wanted) low = middle + 1;
            else high = middle;
        }
        return low < of_.count && block(low) == wanted ? low : of_.count;
    }

    Around around(size_t n) const {
        Around found{};
        const Block own = block(n);
        for (int k = 0; k < 8; ++k) found.block[k] = find({own[0] + (k & 1), own[1] + (k >> 1 & 1), own[2] + (k >> 2)});
        return found;
    }

    // Masks of the known and inside voxels of a block and of the first ones around it.
    void gather(const Around& blocks) {
        for (int z = 0; z < kWide; ++z)
            for (int y = 0; y < kWide; ++y)
                for (int x = 0; x < kWide; ++x) {
                    const size_t from = blocks.block[(z / kSide) << 2 | (y / kSide) << 1 | x / kSide];
                    const int at = place(x, y, z);
                    known_[at] = false;
                    if (from == of_.count) continue;
                    const size_t value = kVoxels * from + static_cast<size_t>(voxel(x % kSide, y % kSide, z % kSide));
                    known_[at] = of_.weights[value] > least_;
                    values_[at] = of_.distances[value];
                }
    }

    // Makes a vertex on each edge of a block between known voxels that are on two sides.
    void cross(size_t n) {
        const Around blocks = around(n);
        gather(blocks);
        Crossed& crossed = crossed_[n];
        const Block own = block(n);
        const int strides[3] = {place(1, 0, 0), place(0, 1, 0), place(0, 0, 1)};
        for (int edge = 0; edge < kEdges; ++edge) {
            if (edge % 64 == 0) crossed.first[static_cast<size_t>(edge / 64)] = static_cast<int32_t>(vertices.size());
            const int axis = edge / kVoxels, x = edge % kSide, y = edge / kSide % kSide,
                      z = edge / kSide / kSide % kSide;
            const int a = place(x, y, z), b = a + strides[axis];
            if (!known_[a] || !known_[b] || (values_[a] < 0.0f) == (values_[b] < 0.0f)) continue;
            crossed.edges[static_cast<size_t>(edge / 64)].set(static_cast<size_t>(edge % 64));
            const int offsets[3] = {x, y, z};
            std::array<double, 3> p;
            for (int d = 0; d < 3; ++d) p[static_cast<size_t>(d)] = 8.0 * own[static_cast<size_t>(d)] + offsets[d];
            const double from = values_[a], to = values_[b];
            p[static_cast<size_t>(axis)] += from / (from - to);
            for (double& number : p) number *= of_.voxel;
            vertices.push_back(p);
        }
        const bool first = values_[0] < 0.0f;
        bool mixed = false;
        for (int k = 0; k < kWide * kWide * kWide; ++k)
            mixed |= known_[k] && (!known_[0] || (values_[k] < 0.0f) != first);
        mixed_[n] = mixed;
    }

    void polygonize(size_t n) {
        static const Cases cases;
        const Around blocks = around(n);
        gather(blocks);
        for (int z = 0; z < kSide; ++z)
            for (int y = 0; y < kSide; ++y)
                for (int x = 0; x < kSide; ++x) {
                    int inside = 0;
                    bool known = true;
                    for (int k = 0; k < 8; ++k) {
                        const int at = place(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2));
                        known = known && known_[at];
                        inside |= (values_[at] < 0.0f) << k;
                    }
                    if (!known) continue;
                    for (const auto& triangle : cases[inside])
                        faces.push_back({vertex(blocks, x, y, z, triangle[0]), vertex(blocks, x, y, z, triangle[1]),
                                         vertex(blocks, x, y, z, triangle[2])});
                }
    }

    int32_t vertex(const Around& blocks, int x, int y, int z, Edge edge) const {
        x += edge.corner & 1, y += edge.corner >> 1 & 1, z += edge.corner >> 2;
        const Crossed& crossed = crossed_[blocks.block[(z / kSide) << 2 | (y / kSide) << 1 | x / kSide]];
        const int number = kVoxels * edge.axis + voxel(x % kSide, y % kSide, z % kSide);
        const std::bitset<64>& word = crossed.edges[static_cast<size_t>(number / 64)];
        const size_t before = (word << static_cast<size_t>(64 - number % 64)).count();
        return crossed.first[static_cast<size_t>(number / 64)] + static_cast<int32_t>(before);
    }

    const mr_blocks& of_;
    float least_;
    std::vector<Crossed> crossed_;
    std::vector<char> mixed_;
    float values_[kWide * kWide * kWide] = {};
    bool known_[kWide * kWide * kWide] = {};
};

bool ascending(const mr_blocks& of) {
    for (size_t n = 0; n + 1 < of.count; ++n)
        if (!std::lexicographical_compare(of.blocks + 3 * n, of.blocks + 3 * n + 3, of.blocks + 3 * n + 3,
                                          of.blocks + 3 * n + 6))
            return false;
    return true;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

struct mr_zero {
    Zero zero;
};

int mr_zero_create(const mr_blocks* of, float least, mr_zero** out, mr_mesh* mesh) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        if (!ascending(*of)) return MR_BAD_INPUT;
        *out = new mr_zero{Zero(*of, least)};
        const Zero& zero = (*out)->zero;
        *mesh = {zero.vertices.empty() ? nullptr : zero.vertices[0].data(), zero.vertices.size(),
                 zero.faces.empty() ? nullptr : zero.faces[0].data(), zero.faces.size()};
        return MR_OK;
    });
}

void mr_zero_destroy(mr_zero* zero) { delete zero; }
