// Connectivity as corners: corner c is that of face c / 3, and beside it lies the corner across from its edge.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "../src/draco_faces.h"

namespace meshreel {

constexpr int32_t kNoCorner = -1;

inline int32_t next_corner(int32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
inline int32_t previous_corner(int32_t corner) { return corner % 3 == 0 ? corner + 2 : corner - 1; }

struct CornerTable {
    std::vector<int32_t> vertices;  // of each corner
    std::vector<int32_t> opposite;  // corner across the edge that a corner faces, or kNoCorner
    std::vector<int32_t> leftmost;  // of each vertex a corner: on a border, the one that no face lies left of

    int32_t across(int32_t corner) const { return corner == kNoCorner ? kNoCorner : opposite[corner]; }
    int32_t right_of(int32_t corner) const { return across(next_corner(corner)); }
    int32_t left_of(int32_t corner) const { return across(previous_corner(corner)); }
    // The corner at the same vertex in the face left of this one, or right of it; kNoCorner at a border.
    int32_t swing_left(int32_t corner) const {
        const int32_t beyond = right_of(corner);
        return beyond == kNoCorner ? kNoCorner : next_corner(beyond);
    }
    int32_t swing_right(int32_t corner) const {
        const int32_t beyond = left_of(corner);
        return beyond == kNoCorner ? kNoCorner : previous_corner(beyond);
    }
};

// The faces of edgebreaker's symbols, in the order of decoding; vertices are numbered as Draco numbers them. Throws
// FormatError where the symbols are of no surface. `faces` must have passed read_draco_faces.
CornerTable make_corners(const DracoFaces& faces, const DracoClaims& claims);

}  // namespace meshreel
