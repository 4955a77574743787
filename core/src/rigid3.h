// Three-vectors, 3 x 3 matrices and the rotation nearest to a matrix, for the hot loops of tracking.
#pragma once

#include <cmath>

namespace meshreel {

struct Vec {
    double x, y, z;
};

inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline Vec load(const double* p) { return {p[0], p[1], p[2]}; }
inline void store(double* p, Vec a) { p[0] = a.x, p[1] = a.y, p[2] = a.z; }

struct Matrix {
    Vec row[3];
};

inline Vec operator*(const Matrix& m, Vec a) { return {dot(m.row[0], a), dot(m.row[1], a), dot(m.row[2], a)}; }
inline Matrix identity() { return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}; }
inline Vec column(const Matrix& m, int k) {
    if (k == 0) return {m.row[0].x, m.row[1].x, m.row[2].x};
    if (k == 1) return {m.row[0].y, m.row[1].y, m.row[2].y};
    return {m.row[0].z, m.row[1].z, m.row[2].z};
}
inline void add_outer(Matrix& m, Vec a, Vec b) {
    m.row[0] = m.row[0] + a.x * b;
    m.row[1] = m.row[1] + a.y * b;
    m.row[2] = m.row[2] + a.z * b;
}

// The rotation by the rotation vector w, through a unit quaternion that is right to third order and exactly unit.
inline Matrix turn(Vec w) {
    const double n = std::sqrt(1 + 0.25 * dot(w, w));
    const double s = 1 / n;
    const Vec v = (0.5 / n) * w;
    return {{{1 - 2 * (v.y * v.y + v.z * v.z), 2 * (v.x * v.y - s * v.z), 2 * (v.x * v.z + s * v.y)},
             {2 * (v.x * v.y + s * v.z), 1 - 2 * (v.x * v.x + v.z * v.z), 2 * (v.y * v.z - s * v.x)},
             {2 * (v.x * v.z - s * v.y), 2 * (v.y * v.z + s * v.x), 1 - 2 * (v.x * v.x + v.y * v.y)}}};
}

inline Matrix product(const Matrix& a, const Matrix& b) {
    Matrix m;
    for (int r = 0; r < 3; ++r) m.row[r] = a.row[r].x * b.row[0] + a.row[r].y * b.row[1] + a.row[r].z * b.row[2];
    return m;
}

// Turns `r` towards the rotation nearest to `s` (maximal trace of r^T s). Directions that s does not determine keep r:
// so a degenerate neighbourhood (a line, a point) stays well defined. Warm-started, a few steps suffice. It ends after
// a step of `still`, rad^2.
inline void follow(Matrix& r, const Matrix& s, int steps, double still = 1e-16) {
    for (int step = 0; step < steps; ++step) {
        Vec torque{0, 0, 0};
        double alignment = 0, size = 0;
        for (int k = 0; k < 3; ++k) {
            const Vec a = column(r, k), b = column(s, k);
            torque = torque + cross(a, b);
            alignment += dot(a, b);
            size += dot(b, b);
        }
        const Vec w = (1 / (std::fabs(alignment) + 1e-9 * std::sqrt(size) + 1e-300)) * torque;
        r = product(turn(w), r);
        if (dot(w, w) < still) break;
    }
}

}  // namespace meshreel
