// The arithmetic of the form LAYERS: a hierarchy over a mesh's vertices, prediction in it, subdivision along normals.
// Fields of a group are decoded from their records (FORMAT.md).
//
// All of it decides what a decoder shows, so: IEEE + - * / sqrt in a fixed order, no threads, no other functions. (Only
// mr_predict_forward and mr_predict_surface, an encoder's, take logarithms.)
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// A causal graph: value v is predicted by sum_k weights[k] * value[near[k]], k in starts[v] .. starts[v + 1], near[k] <
// v.
struct mr_graph {
    size_t count;
    const int64_t* starts;
    const int32_t* near;
    const double* weights;
};

// An order of a mesh's vertices, coarse to fine, and the graph that predicts each from those before it.
typedef struct mr_hierarchy mr_hierarchy;
int mr_hierarchy_create(const struct mr_mesh* mesh, mr_hierarchy** out);
void mr_hierarchy_destroy(mr_hierarchy* hierarchy);
const int32_t* mr_hierarchy_order(const mr_hierarchy* hierarchy);   // the vertex at each place
struct mr_graph mr_hierarchy_graph(const mr_hierarchy* hierarchy);  // of places

// Quantises `columns` columns of values in a closed loop: `decoded` is what the symbols decode to. A magnitude is
// lowered where that saves more than `price` squared steps a bit. Encoder only.
int mr_predict_forward(const struct mr_graph* graph, const double* values, size_t columns, double step, double price,
                       int32_t* symbols, double* decoded);

// The metric of errors in a field of places: errors of `columns` weights of `vectors` (rows of `width` numbers, three a
// frame) count in full along the unit normals (`width` numbers for each of the graph's vertices), `tangential` times
// across them.
struct mr_surface {
    size_t columns, width;
    const double* vectors;
    const double* normals;
    double tangential;
};
// As mr_predict_forward, in the metric of a surface. Encoder only.
int mr_predict_surface(const struct mr_graph* graph, const struct mr_surface* surface, const double* values,
                       double step, double price, int32_t* symbols, double* decoded);

// Orthonormal vectors of `width` numbers. The k-th is coded as width - k integers: its direction in the space that
// those before it leave, once reflections have turned them onto the first k axes. MR_NO_DIRECTION where all of these
// are zero.
int mr_orthonormal_inverse(const int32_t* symbols, size_t count, size_t width, double* vectors);

// The rows of a CodedField record over a graph: `width` numbers for each value. Row v is the sum over k, in order, of
// vector k * decoded[k][v], where decoded[k][v] = prediction + step * symbol[k][v]. `head` integers before the basis
// are left out.
int mr_decode_field(const struct mr_bytes* record, const struct mr_graph* graph, size_t width, size_t head,
                    double* rows);

// The motion of a LayersGroup record of `frames` frames over its decoded base mesh, as rows: for each vertex the x of
// all frames, then their y, then their z.
int mr_decode_motion(const struct mr_bytes* record, const struct mr_mesh* base, size_t frames, double* rows);

// The same places in the last frame alone: three numbers for each vertex. MR_BAD_RECORD where there is no frame.
int mr_decode_last_places(const struct mr_bytes* record, const struct mr_mesh* base, size_t frames, double* positions);

// The sorted edges of a mesh and its faces cut in four. `edges` has room for 3 face_count pairs, of which `edge_count`
// are set.
int mr_subdivide(const int32_t* faces, size_t face_count, size_t vertices, int32_t* edges, int32_t* finer,
                 size_t* edge_count);
// The siblings of each edge, sorted: the edges before it that share a face with it. `near` has room for 3 face_count
// entries.
int mr_siblings(const int32_t* finer, size_t face_count, size_t vertices, size_t edge_count, int64_t* starts,
                int32_t* near);

// A subdivision of a mesh that moves. Its places are rows, as mr_decode_motion makes them.
struct mr_level {
    size_t frames, vertices;  // of the coarser mesh
    const int32_t* faces;
    size_t face_count;
    const int32_t* edges;
    size_t edge_count;
    // For decoding only:
    const int64_t* starts;  // the siblings of edge e are near[starts[e] .. starts[e + 1])
    const int32_t* near;
    const double* previous;  // scalars in the last frame of the group before, or null
};
// Each coordinate is placed at origin + scale * coordinate.
struct mr_placement {
    double scale, origin[3];
};
// Places as frames x vertices x 3.
struct mr_frames {
    double* positions;
    const struct mr_placement* placement;  // or null: coordinates stay as they are
    float* singles;                        // or null: gets the nearest floats, and `positions` nothing
};
// Curved midpoints of the edges of one frame, and at each midpoint a direction: the unit sum of the normals at both
// ends, zero where there is none. `curvature`, 64ths, is the share of the bend of an edge, as the normals at its ends
// give it, by which its midpoint is lifted. Encoder only.
int mr_edge_frames(const struct mr_level* level, const double* positions, int curvature, double* midpoints,
                   double* directions);
// The finer level's vertices: the coarser one's, then midpoint + scalar * direction for each edge. `scalars` has a row
// of one number a frame for each edge. MR_NOT_FINITE where a coordinate is not finite before it is placed. Encoder
// only.
int mr_refine(const struct mr_level* level, const double* rows, int curvature, const double* scalars,
              const struct mr_frames* frames);
// The same of the scalars of a LayersLevel record, of which `last` gets those of the last frame. The first writes rows
// behind those of the coarser level, for which `rows` has room.
int mr_decode_level(const struct mr_bytes* record, const struct mr_level* level, double* rows, double* last);
int mr_decode_last_level(const struct mr_bytes* record, const struct mr_level* level, const double* rows, double* last,
                         const struct mr_frames* frames);
// The last frame's scalars alone, from which the next group is predicted: nothing is placed.
int mr_decode_last_scalars(const struct mr_bytes* record, const struct mr_level* level, double* last);
// Rows as frames, without a further level.
int mr_frames_of_rows(const double* rows, size_t count, size_t vertices, const struct mr_frames* frames);

// Copies the faces of which `dropped` is 0 and returns their number. `kept` has room for all.
size_t mr_keep_faces(const int32_t* faces, const uint8_t* dropped, size_t face_count, int32_t* kept);

#ifdef __cplusplus
}
#endif
