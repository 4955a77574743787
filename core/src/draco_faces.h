// The faces of a Draco mesh, as far as decoding them costs time: edgebreaker's symbols and the boundary that they move.
#pragma once

#include <cstdint>
#include <vector>

#include "draco_reader.h"

namespace meshreel {

// What a Draco mesh says of itself before its faces.
struct DracoClaims {
    uint64_t faces, points;
    uint64_t symbols;  // of the traversal; each has a face
    uint64_t splits;   // of these; Draco takes memory for a point more at each
};

enum class DracoTraversal : uint8_t { Standard = 0, ByValence = 2 };

// True where the faces that follow are those that are claimed. `steps` is about how many corners Draco renames, one by
// one, to join them: for damaged faces this grows with the square of their number.
bool read_draco_faces(DracoReader& in, DracoTraversal traversal, const DracoClaims& claims, uint64_t& steps);

}  // namespace meshreel
