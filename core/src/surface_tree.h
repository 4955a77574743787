// A tree of boxes over the triangles of a mesh; four children a node, up to four triangles a leaf.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshreel/status.h"
#include "rigid3.h"

namespace meshreel {

struct Hit {
    int32_t face;                   // -1: nothing within reach
    std::array<double, 3> weights;  // of its corners, at the closest point
};

class SurfaceTree {
public:
    // Faces must be in range.
    explicit SurfaceTree(const mr_mesh& mesh);

    void move(const double* positions);

    // `guess` is a face that may be near, or -1; `gone` is null or marks faces that are left out.
    Hit closest(Vec query, double reach, int32_t guess, const uint8_t* gone = nullptr) const;

    // The same for many queries; each begins with its guess, or without one with what the query before it found. They
    // are visited along a curve, so that neighbours follow each other.
    void closest(const double* queries, size_t count, double reach, const uint8_t* gone, int32_t* faces,
                 double* weights) const;

    struct Rays {
        const double *origins, *ways;  // count x 3
        size_t count;
        bool one_origin;  // for all
    };

    // What each ray meets first, -1: nothing; how many times its way off, infinite: nothing; and, unless `weights` is
    // null, the weights of the corners there.
    void cast(const Rays& rays, int32_t* faces, double* distances, double* weights) const;

    size_t face_count() const { return faces_.size(); }
    size_t vertex_count() const { return vertices_; }
    const std::array<int32_t, 3>& face(size_t f) const { return faces_[f]; }

private:
    static constexpr int kWide = 4;
    static constexpr int32_t kNothing = INT32_MIN;

    struct Box {
        float low[3], high[3];
    };
    struct Node {
        float low[3][kWide], high[3][kWide];
        int32_t child[kWide];  // a node; ~block of a leaf; kNothing
    };
    struct Block {  // of four triangles a, a + e, a + f, side by side; a free place repeats the last one
        float a[3][kWide], e[3][kWide], f[3][kWide];
        float ee[kWide], ef[kWide], ff[kWide];  // products of edges
        float by_ee[kWide], by_ff[kWide], by_gg[kWide],
            by_det[kWide];  // inverses; 0 for edges and triangles without size
        int32_t face[kWide];
    };
    struct Range {
        int32_t begin, end;
    };
    struct Middle {
        float at[4];  // the last is 0
        int32_t face;
    };

    struct Span {  // of a box around all faces: vertices without one do not count
        Vec middle, half;
    };

    Span span_of(const double* positions) const;
    int32_t build(Range range);
    Range halved(Range range);
    std::vector<Range> children(Range range);
    int32_t leaf(Range range);
    void fill(Block& block) const;
    Box box_of(const Block& block) const;
    void refit(Node& node) const;
    Box box_of(int32_t child) const;
    float visit(const Block& block, const float* query, const uint8_t* gone, float best, int32_t& face) const;
    Hit exact(Vec query, int32_t face) const;
    double met(int32_t face, Vec origin, Vec way, double* weights) const;
    Vec corner(int32_t face, int k) const { return load(&positions_[3 * static_cast<size_t>(faces_[face][k])]); }

    size_t vertices_;
    std::vector<std::array<int32_t, 3>> faces_;
    std::vector<double> positions_;  // relative to origin_
    Vec origin_;
    double slack_;                         // of a distance: single precision may miss so much
    std::vector<Middle> middles_, apart_;  // of faces while the tree is built, and room for those of a second half
    std::vector<Node> nodes_;              // children after their parents
    std::vector<Block> blocks_;
    int32_t root_ = kNothing;
};

}  // namespace meshreel
