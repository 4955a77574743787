// Connectivity, normals and points of triangle meshes: what is asked of each frame that is read, and of each surface
// that is fitted. Encoder only. One thread; sums in the order of the faces; time and memory in proportion to the mesh,
// but for sorting what a hostile mesh repeats. MR_BAD_INPUT for a face that refers to a missing vertex.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Remainder of a mesh: vertices and faces in their order. There is room for all of them; the counts are set.
struct mr_rest {
    double* positions;
    size_t vertices;
    int32_t* faces;
    size_t face_count;
    int32_t *vertex_origins, *face_origins;  // the number that each had in the mesh; or null
};

// Merges vertices at equal positions into the first of them (-0 equals 0, NaN nothing) and drops the faces that
// collapse.
int mr_weld(const struct mr_mesh* mesh, struct mr_rest* rest);

// Drops collapsed faces, faces without an area, faces with the vertices of one before them, then vertices that no face
// uses.
int mr_clean(const struct mr_mesh* mesh, struct mr_rest* rest);

// Drops vertices that no face uses.
int mr_drop_unreferenced(const struct mr_mesh* mesh, struct mr_rest* rest);

// The connected component of each vertex; components are numbered by their first vertex.
int mr_components(const int32_t* faces, size_t face_count, size_t vertices, int32_t* labels);

// Unit normals and areas of the faces; a zero area has a zero normal.
int mr_face_normals(const struct mr_mesh* mesh, double* normals, double* areas);

// Unit normals of the vertices, weighted by the areas of their faces; zero where no face has an area. For each vertex
// the faces are summed that have it as their first corner, then as their second, then as their third.
int mr_vertex_normals(const struct mr_mesh* mesh, double* normals);

// The positions of each face's corners, added up with their weights; without weights their mean.
int mr_blend(const struct mr_mesh* mesh, const double* weights, double* points);

// Cuts each face into parts^2 equal parts, 1 to `most`^2, whose sides are at most `spacing` long where `most` allows
// it. Sets the number of all parts; then the middles of those of each face, and the face of each.
int mr_spread_parts(const struct mr_mesh* mesh, double spacing, int32_t most, int32_t* parts, size_t* count);
int mr_spread(const struct mr_mesh* mesh, const int32_t* parts, double* points, int64_t* faces);

#ifdef __cplusplus
}
#endif
