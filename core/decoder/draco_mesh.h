// A mesh out of Draco's bytes (bitstream specification, 2.2), of the one kind that FORMAT.md allows ("A mesh").
#pragma once

#include "mesh.h"
#include "meshreel/status.h"

namespace meshreel {

// Vertices and faces in Draco's order, each coordinate rounded to a multiple of `step`. No bytes are the empty mesh.
// Throws FormatError.
Mesh decode_draco(const mr_bytes& data, double step);

}  // namespace meshreel
