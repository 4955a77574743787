// What Draco may be given: it takes memory for what its bytes claim, before it knows whether they hold it. FORMAT.md
// ("A mesh") has the same rules in words.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Checks Draco meshes before Draco sees them: each is of the one kind that encoders of this format write, and all of
// them together claim no more faces or points than so many bytes may. Takes no memory; time in proportion to bytes and
// claims.
int mr_check_draco(const struct mr_bytes* meshes, size_t count);

#ifdef __cplusplus
}
#endif
