// The parts of a Draco mesh, checked by the rules of FORMAT.md ("A mesh").
#pragma once

#include <cstdint>
#include <vector>

#include "draco_faces.h"
#include "meshreel/status.h"

namespace meshreel {

// Positions on a lattice, as far as they are told from what predicts them.
struct DracoPositions {
    std::vector<uint32_t> corrections;  // three a point, signs in the lowest bit
    int32_t least, most;                // lattice coordinates that sums are wrapped into
    float corner[3], width;             // of the lattice
    int bits;
};

struct DracoParts {
    DracoClaims claims{};
    DracoFaces faces;
    DracoPositions positions;
};

// Returns a status. Checks what mr_check_draco does of a single mesh. May throw std::bad_alloc.
int read_draco(const mr_bytes& mesh, DracoParts& parts);

}  // namespace meshreel
