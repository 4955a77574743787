// The faces of a Draco mesh, as far as decoding them costs time: edgebreaker's symbols and the boundary that they move.
#pragma once

#include <cstdint>
#include <vector>

#include "draco_reader.h"

namespace meshreel {

// Head of a Draco mesh, before its faces.
struct DracoClaims {
    uint64_t faces, points;
    uint64_t symbols;  // of the traversal; each has a face
    uint64_t splits;   // of these; Draco takes memory for a point more at each
    uint64_t steps;  // corners that Draco renames, one by one: for damaged faces as many as the square of their number
};

enum class DracoTraversal : uint8_t { Standard = 0, ByValence = 2 };

// Edgebreaker's symbols (J. Rossignac 1999), in the order of their numbers.
namespace clers {
enum Symbol : uint8_t { C, S, L, R, E, kSymbols };
}

// A split that closes a handle: an edge beside the face of one symbol waits for the face of another. Symbols are
// numbered as they were coded, the last one decoded first.
struct DracoHandle {
    uint64_t source, split;
    bool is_right;
};

// Symbols from which the faces are made.
struct DracoFaces {
    std::vector<uint8_t> symbols;  // in the order of decoding
    std::vector<DracoHandle> handles;
    uint8_t start_chance = 0;  // that a component does not start within its surface, 256ths
    DracoReader starts;        // whether each does, coded
};

// True where the faces that follow are those that are claimed. Sets the claims' steps; the second also what they are
// made from.
bool read_draco_faces(DracoReader& in, DracoTraversal traversal, DracoClaims& claims);
bool read_draco_faces(DracoReader& in, DracoTraversal traversal, DracoClaims& claims, DracoFaces& faces);

}  // namespace meshreel
