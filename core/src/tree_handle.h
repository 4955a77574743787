// The object behind the handle of a tree in the C ABI.
#pragma once

#include "meshreel/tree.h"
#include "surface_tree.h"

struct mr_tree {
    meshreel::SurfaceTree tree;
};

namespace meshreel {

inline const SurfaceTree& tree_of(const mr_tree* handle) { return handle->tree; }

}  // namespace meshreel
