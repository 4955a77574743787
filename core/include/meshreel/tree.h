// Closest points of a triangle mesh and rays that meet it, found in a tree of boxes. Encoder only. One thread; single
// precision decides which face is closest, relative to the middle of the mesh.
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
// Unless `gone` is null, it has a byte for each face: those that are not 0 are left out.
int mr_tree_closest(const mr_tree* tree, const double* queries, size_t count, double reach, const uint8_t* gone,
                    int32_t* faces, double* weights);

// Rays from `origins` along `ways`, count x 3 each, or all from one origin.
struct mr_rays {
    const double *origins, *ways;
    size_t count;
    int one_origin;
};

// For each ray, the first face that it meets from either side, -1 for none; how many times its way that is off,
// infinite for none; and, unless `weights` is null, the weights of the three corners there, (1, 0, 0) for none.
int mr_tree_cast(const mr_tree* tree, const struct mr_rays* rays, int32_t* faces, double* distances, double* weights);

#ifdef __cplusplus
}
#endif
