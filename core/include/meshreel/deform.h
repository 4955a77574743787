// Embedded deformation (Sumner et al. 2007): Gauss-Newton rounds that move a graph of nodes on a mesh to a frame.
// Encoder only. One thread, sums in a fixed order; equations are solved in single precision, poses are double.
//
// A point p bound to nodes j with weights w goes to sum w_j (R_j (p - g_j) + t_j). A round matches samples of the mesh
// and of the frame by closest points, both ways, as point-to-plane rows; rows for each edge (i, j) keep R_i (g_j - g_i)
// + t_i at t_j. A pair counts by a Gaussian of its distance, sigma half the gate, and not past the gate, where normals
// disagree, or on the frame's open borders.
#pragma once

#include "meshreel/tree.h"

#ifdef __cplusplus
extern "C" {
#endif

struct mr_deformation {
    const double* nodes;  // node_count x 3, at rest
    size_t node_count;
    const int32_t* edges;  // edge_count x 2, both directions of each
    size_t edge_count;
    const double* held;     // of each edge, a factor of its squared row weight
    const double* points;   // sample_count x 3, on the mesh at rest
    const double* normals;  // unit normals of the mesh there
    size_t sample_count;
    const int32_t* bound;   // sample_count x bonds: nodes that move each sample
    const double* weights;  // the same shape; rows sum to 1
    size_t bonds;
};

struct mr_seen {  // a frame and samples of it
    struct mr_mesh mesh;
    const mr_tree* tree;
    const double* normals;  // of its vertices
    const uint8_t* inside;  // 1 for each vertex that is on no open border
    const double* points;   // sample_count x 3
    const double* point_normals;
    size_t sample_count;
    double spacing;  // of the samples: a sample of the mesh is that far from the nearest one anyway
};

struct mr_deform_rounds {
    size_t count;
    const double* gates;     // of each round, > 0
    const double* rigidity;  // of each round: squared row weight of an edge relative to the mean data of a node
    double torn;             // an edge off by this share of its length counts a quarter (Geman and McClure)
    double place;            // squared row weight towards the pose a round begins with, relative to the same
    double agreement;        // smallest cosine between the normals of a pair
    double tolerance;        // relative residual of the conjugate gradients; larger before the last round
    int32_t iterations;
};

// Moves the pose (rotations, node_count x 9, row by row; positions, x 3) by all rounds, or by those before the first
// that gives numbers that are not finite.
int mr_deform(const struct mr_deformation* graph, const struct mr_seen* frame, const struct mr_deform_rounds* rounds,
              double* rotations, double* positions);

// The sum of the weights of all pairs at a pose, with one gate > 0.
int mr_deform_matched(const struct mr_deformation* graph, const struct mr_seen* frame, double gate, double agreement,
                      const double* rotations, const double* positions, double* sum);

// The factor of each edge by how much a pose tears it, times `held`.
int mr_deform_holds(const struct mr_deformation* graph, double torn, const double* rotations, const double* positions,
                    double* holds);

#ifdef __cplusplus
}
#endif
