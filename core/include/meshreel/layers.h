// The arithmetic of the form LAYERS: a hierarchy over a mesh's vertices, prediction in it, subdivision along normals.
//
// All of it decides what a decoder shows, so: IEEE + - * / sqrt in a fixed order, no threads, no other functions. (Only
// mr_predict_forward and mr_predict_surface, an encoder's, take logarithms.)
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum mr_layers_status {
    MR_LAYERS_OK = 0,
    MR_LAYERS_BAD_INPUT = 1,  // an index out of range, or a graph that is not causal
    MR_LAYERS_NO_MEMORY = 2,
    MR_LAYERS_OVERFLOW = 3,  // a symbol beyond 32 bits
};

// A causal graph: value v is predicted by sum_k weights[k] * value[near[k]], k in starts[v] .. starts[v + 1], near[k] < v.
struct mr_graph {
    size_t count;
    const int64_t* starts;
    const int32_t* near;
    const double* weights;
};

// An order of a mesh's vertices, coarse to fine, and the graph that predicts each from those before it.
typedef struct mr_hierarchy mr_hierarchy;
int mr_hierarchy_create(const double* positions, size_t vertices, const int32_t* faces, size_t face_count, mr_hierarchy** out);
void mr_hierarchy_destroy(mr_hierarchy* hierarchy);
const int32_t* mr_hierarchy_order(const mr_hierarchy* hierarchy);  // the vertex at each place
struct mr_graph mr_hierarchy_graph(const mr_hierarchy* hierarchy);  // of places

// An orthonormal basis, and what is added to all that is made in it (nothing where null).
struct mr_basis {
    size_t columns, width;
    const double* vectors;  // columns x width
    const double* means;
};
// A field as coded. The row of value v is row[t] = means[t] + the sum over k, in order, of vectors[k][t] * decoded[k][v], where
// decoded[k][v] = prediction + step * symbols[k][v]; then before[v] is added, where there is such an array.
struct mr_field {
    struct mr_graph graph;
    struct mr_basis basis;
    const int32_t* symbols;  // column after column
    double step;
    const double* before;  // or null
};
// Its rows, one for each value.
int mr_field_inverse(const struct mr_field* field, double* rows);
// Symbols so that `decoded` is near `values`; a magnitude is lowered where that saves more than `price` squared steps a bit.
int mr_predict_forward(const struct mr_graph* graph, const double* values, size_t columns, double step, double price,
                       int32_t* symbols, double* decoded);

// Where a field of places is seen from: errors of `columns` weights of `vectors` (rows of `width` numbers, three a frame)
// count in full along the unit normals (`width` numbers for each of the graph's vertices), `tangential` times across them.
struct mr_surface {
    size_t columns, width;
    const double* vectors;
    const double* normals;
    double tangential;
};
// As mr_predict_forward, in the metric of a surface. An encoder's.
int mr_predict_surface(const struct mr_graph* graph, const struct mr_surface* surface, const double* values, double step, double price,
                       int32_t* symbols, double* decoded);

// Orthonormal vectors of `width` numbers. The k-th is said by width - k integers: its direction where those before it,
// turned onto the first k axes by reflections, leave room for it. MR_LAYERS_BAD_INPUT where all of these are zero.
int mr_orthonormal_inverse(const int32_t* symbols, size_t count, size_t width, double* vectors);

// The row of the vertex order[p], all frames of an axis after the other: the displacements in row p, frame after frame x, y
// and z, from its place in `base`. Returns 1 where all of them are finite.
int mr_place_rows(const double* moved, const int32_t* order, const double* base, size_t vertices, size_t frames, double* rows);

// The sorted edges of a mesh and its faces cut in four. `edges` has room for 3 face_count pairs, of which `edge_count` are set.
int mr_subdivide(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* finer, size_t* edge_count);
// For each edge those that share a face with it and come before it, sorted; `near` has room for 3 face_count entries.
int mr_siblings(const int32_t* finer, size_t face_count, size_t vertices, size_t edge_count, int64_t* starts, int32_t* near);
// Weights that predict each by weight / 64 of the mean of those near it.
void mr_sibling_weights(const int64_t* starts, size_t edge_count, int weight, double* weights);

// A subdivision of a mesh that moves. Its places are rows: all frames' x of a vertex, then their y, then their z.
struct mr_level {
    size_t frames, vertices;  // of the coarser mesh
    const int32_t* faces;
    size_t face_count;
    const int32_t* edges;
    size_t edge_count;
    int curvature;  // share of the bend that the normals at both ends of an edge say by which its midpoint is lifted, 64ths
};
// Where places lie in the world: each coordinate at origin + scale * coordinate.
struct mr_placement {
    double scale, origin[3];
};
// Places as frames x vertices x 3.
struct mr_frames {
    double* positions;
    const struct mr_placement* placement;  // or null: left as they are
    int finite;                            // becomes 1 where all of them are, before they are placed
};
// Curved midpoints of the edges, and along the unit sum of both ends' normals a direction (zero where there is none), of one frame.
int mr_edge_frames(const struct mr_level* level, const double* positions, double* midpoints, double* directions);
// The finer level's vertices: the coarser one's, then midpoint + scalar * direction for each edge; a row of scalars for each.
int mr_refine(const struct mr_level* level, const double* rows, const double* scalars, struct mr_frames* frames);
// The same of a field of scalars, of which `last` gets those of the last frame. The first writes rows behind those of the
// coarser level, for which `rows` has room.
int mr_refine_field(const struct mr_level* level, const struct mr_field* field, double* rows, double* last);
int mr_refine_field_frames(const struct mr_level* level, const struct mr_field* field, const double* rows, double* last,
                           struct mr_frames* frames);
// Rows as they are.
int mr_frames_of_rows(const double* rows, size_t count, size_t vertices, struct mr_frames* frames);

// Copies the faces of which `dropped` is 0; their number. `kept` has room for all.
size_t mr_keep_faces(const int32_t* faces, const uint8_t* dropped, size_t face_count, int32_t* kept);

#ifdef __cplusplus
}
#endif
