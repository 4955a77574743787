// Closest points of a triangle mesh, found in a tree of boxes. Encoder only. One thread; single precision decides which
// face is closest, relative to the middle of the mesh.
#pragma once

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// A mesh with at least one face, prepared for queries. It keeps no pointer to the arrays it was made from.
typedef struct mr_tree mr_tree;
int mr_tree_create(const struct mr_mesh* mesh, mr_tree** out);
void mr_tree_destroy(mr_tree* tree);

// Gives the vertices other positions, vertices x 3: the boxes grow and shrink with them, the tree stays.
int mr_tree_move(mr_tree* tree, const double* positions);

// For each query, the closest face, and the weights of its three corners at the closest point. In `faces` is a face to
// begin with, the better the faster, or -1; where nothing is within `reach` it is -1 afterwards, and weights are 0.
int mr_tree_closest(const mr_tree* tree, const double* queries, size_t count, double reach, int32_t* faces,
                    double* weights);

#ifdef __cplusplus
}
#endif
