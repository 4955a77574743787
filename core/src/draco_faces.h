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
    uint64_t steps;  // corners that Draco renames, one by one: for damaged faces as many as the square of their number
};

enum class DracoTraversal : uint8_t { Standard = 0, ByValence = 2 };

// True where the faces that follow are those that are claimed. Sets the claims' steps.
bool read_draco_faces(DracoReader& in, DracoTraversal traversal, DracoClaims& claims);

}  // namespace meshreel
