// Decimation of triangle meshes by quadric error metrics (Garland and Heckbert 1997). Encoder only. One thread; the
// same mesh always gives the same bits. MR_BAD_INPUT for a face that refers to a missing vertex.
#pragma once

#include <stddef.h>

#include "meshreel/status.h"
#include "meshreel/topology.h"

#ifdef __cplusplus
extern "C" {
#endif

// Collapses edges, those first that cost least, until at most `faces` are left or no edge can be collapsed without
// turning a face over. `border` weighs the planes that stand on open borders against those of the faces.
int mr_decimate(const struct mr_mesh* mesh, size_t faces, double border, struct mr_rest* rest);

#ifdef __cplusplus
}
#endif
