// The fit of a template, a mesh of constant connectivity, to the surface of a frame. Encoder only. One thread, sums in
// a fixed order; equations are solved in single precision, positions are double.
//
// A round matches the closest points of both surfaces, both ways, as point-to-plane rows, and samples of their open
// borders as rows along and across the surface. It then takes one step from positions x to those that minimise
//   sum rows w (n . x - value)^2 + smoothing^2 |L x - shape|^2 + anchor^2 |x - place|^2,
// L the uniform Laplacian. A pair counts by a Gaussian of its distance, sigma half the gate; it does not count past the
// gate, where normals disagree, and on open borders, past which nothing is known.
#pragma once

#include "meshreel/tree.h"

#ifdef __cplusplus
extern "C" {
#endif

// Connectivity prepared for fitting. It remembers a tree between calls: one call at a time.
typedef struct mr_template mr_template;
int mr_template_create(const int32_t* faces, size_t face_count, size_t vertices, mr_template** out);
void mr_template_destroy(mr_template* fitted);

// Points on open borders, unit normals of the surface there, and unit directions in it, away from it.
struct mr_rim {
    const double* points;  // count x 3
    const double* normals;
    const double* outward;
    size_t count;
};

// A frame: a mesh, its tree, its unit vertex normals, 1 for each vertex that is on no open border, and its borders.
struct mr_target {
    struct mr_mesh mesh;
    const mr_tree* tree;
    const double* normals;
    const uint8_t* inside;
    struct mr_rim rim;
};

struct mr_fit_rounds {
    size_t count;
    const double* gates;      // of each round, > 0
    const double* smoothing;  // of each round, row weights
    const int32_t* strides;   // of each round, >= 1: every so manieth point is matched, and counts so many times
    double agreement;         // smallest cosine between the normals of a pair
    double anchor;            // row weight
    double tolerance;         // relative residual of the conjugate gradients; larger before the last round
    int32_t iterations;       // at most
    int32_t turn;             // whether the shape, L rest, turns with each vertex's neighbourhood
};

// Samples on a border edge of the template.
enum { MR_RIM_SAMPLES = 8 };

// Fits `positions`, vertices x 3: in, where to begin; out, the fit. `rest` has the shape to keep, `place` where to
// stay.
int mr_fit(mr_template* fitted, const struct mr_target* target, const struct mr_fit_rounds* rounds, const double* rest,
           const double* place, double* positions);

// Laplacian coordinates of `rest`, each turned by the rotation of its neighbourhood from `rest` to `now`; V x 3.
int mr_turned_laplacian(const mr_template* fitted, const double* rest, const double* now, double* shape);

#ifdef __cplusplus
}
#endif
