// Connectivity of a mesh that is fitted: neighbours, edges, open borders.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "rigid3.h"
#include "surface_tree.h"

namespace meshreel {

struct Template {
    // Faces must be in range.
    Template(const int32_t* corners, size_t face_count, size_t vertices);

    struct Side {  // of a face: its corners `from` and `from` + 1 span an edge that no second face has
        int32_t face, from;
    };

    size_t count;
    std::vector<std::array<int32_t, 3>> faces;
    std::vector<std::array<int32_t, 3>> face_edges;  // of the corners 01, 12, 20
    std::vector<std::array<int32_t, 2>> edges;       // the smaller vertex first, in order
    std::vector<int32_t> starts, near;               // neighbours of each vertex, ascending
    std::vector<float> shares;                       // 1 / their number; 0 for none
    std::vector<int32_t> corners;                    // 3 face + k of a corner at each vertex; -1 for none
    std::vector<uint8_t> inside;                     // 0 at open borders
    std::vector<Side> sides;

    // A tree of the surface, for a fit alone: several may run side by side. All are built at the rest of the first fit,
    // which those beside it share, so that answers do not depend on which tree a fit gets.
    std::unique_ptr<SurfaceTree> take_tree(const double* rest) const;
    void give_tree(std::unique_ptr<SurfaceTree> tree) const;

private:
    mutable std::mutex mutex_;
    mutable std::vector<double> rest_;
    mutable std::vector<std::unique_ptr<SurfaceTree>> free_;
};

// Rows L x of positions, x 3: each vertex minus the mean of its neighbours.
void laplacian(const Template& fitted, const double* positions, std::vector<Vec>& rows);

// The rotation of each vertex's neighbourhood from `rest` to `now`, averaged over rings. `turns` is empty, or has
// rotations to begin with.
void neighbourhood_turns(const Template& fitted, const double* rest, const double* now, std::vector<Matrix>& turns);

}  // namespace meshreel
