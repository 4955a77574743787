// Splats: flat Gaussians on the faces of a base mesh, and where they are in a frame. Beside
// src/meshreel/{coding/appearance,geometry}/splats.py.
#pragma once

#include <cstdint>
#include <vector>

#include "group.h"

namespace meshreel {

struct Splat {
    int32_t face;              // of the base mesh
    double weights[2];         // of its second and its third corner
    double offset;             // from the face, along its normal; normalised
    double turn;               // rad, of the longer axis from the face's first edge
    double scales[2];          // along the longer axis and the shorter; normalised
    uint8_t rungs[2];          // of these, before they grew
    double opacity, color[3];  // sRGB, 0 to 1
};

struct Splats {
    std::vector<Splat> all;
    double growth = 1;  // that the scales have, for there are fewer than were coded
};

// Where a splat is after subdivisions: a face, the weights of its corners, and the first edge of the base's face there.
struct Located {
    size_t face;
    double weights[3], along[3];
};

Located locate(const Splat& splat, unsigned levels);

// Gaussians in space, of each the numbers side by side.
struct Bound {
    std::vector<double> means, axes, scales, opacities, colors;
};

// Of a payload, or of its first layers, on a base mesh of so many faces. Throws FormatError.
Splats decode_splats(const mr_bytes& data, size_t faces);

// The splats in frame t of a group; `unit` is what lengths count in its positions.
Bound bind_splats(const std::vector<Splat>& splats, const Group& group, size_t t, double unit);

}  // namespace meshreel
