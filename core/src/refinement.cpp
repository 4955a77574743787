#include <algorithm>
#include <cmath>
#include <vector>

#include "arrays.h"
#include "field_record.h"
#include "guarded.h"
#include "meshreel/layers.h"
#include "scratch.h"
#include "wide.h"

namespace meshreel {
namespace {

constexpr double kMostBend = 0.15;  // of an edge's length (guess): noisy normals lift no midpoint farther

// Rows of places or normals: all frames' x of a vertex, then their y, then their z. A loop over frames is one over
// neighbours in memory, and each frame's numbers come about as if it were alone.
struct Rows {
    const double* data;
    size_t frames;
    const double* of(int32_t v) const { return data + 3 * frames * static_cast<size_t>(v); }
};

void face_normal(const Rows& p, const int32_t* face, double* __restrict n) {
    const size_t frames = p.frames;
    const double *a = p.of(face[0]), *b = p.of(face[1]), *c = p.of(face[2]);
    for (size_t t = 0; t < frames; ++t) {
        const size_t ty = t + frames, tz = ty + frames;
        const double ux = b[t] - a[t], uy = b[ty] - a[ty], uz = b[tz] - a[tz];
        const double wx = c[t] - a[t], wy = c[ty] - a[ty], wz = c[tz] - a[tz];
        n[t] = uy * wz - uz * wy, n[ty] = uz * wx - ux * wz, n[tz] = ux * wy - uy * wx;
    }
}

void add(const double* __restrict more, size_t count, double* __restrict sum) {
    for (size_t k = 0; k < count; ++k) sum[k] += more[k];
}

void normalize(size_t frames, double* __restrict n) {
    for (size_t t = 0; t < frames; ++t) {
        double &x = n[t], &y = n[t + frames], &z = n[t + 2 * frames];
        const double length = std::sqrt(x * x + y * y + z * z);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        x *= scale, y *= scale, z *= scale;
    }
}

Array<double> normals_of(const Rows& p, size_t vertices, const int32_t* faces, size_t face_count) {
    const size_t width = 3 * p.frames;
    Array<double> n(width * vertices, 0.0);
    std::vector<double> one(width);
    for (size_t f = 0; f < face_count; ++f) {
        face_normal(p, faces + 3 * f, one.data());
        for (size_t k = 0; k < 3; ++k) add(one.data(), width, n.data() + width * static_cast<size_t>(faces[3 * f + k]));
    }
    for (size_t v = 0; v < vertices; ++v) normalize(p.frames, n.data() + width * v);
    return n;
}

// Curved midpoint and direction of an edge: on a circle through both ends with their normals, the arc's middle is
// (n_b - n_a) . (b - a) / 8 above the chord's, for small angles.
// Calls visit(frame, place in a row, number of the midpoint, number of the direction).
template <class Visit>
void edge_frame(const Rows& p, const Rows& normals, const int32_t* edge, double share, Visit visit) {
    const size_t frames = p.frames;
    const double *a = p.of(edge[0]), *b = p.of(edge[1]), *m = normals.of(edge[0]), *n = normals.of(edge[1]);
    for (size_t t = 0; t < frames; ++t) {
        const size_t ty = t + frames, tz = ty + frames;
        const double ex = b[t] - a[t], ey = b[ty] - a[ty], ez = b[tz] - a[tz];
        const double bend = ((n[t] - m[t]) * ex + (n[ty] - m[ty]) * ey + (n[tz] - m[tz]) * ez) / 8.0;
        const double most = kMostBend * std::sqrt(ex * ex + ey * ey + ez * ez);
        const double above = bend < -most ? -most : bend;
        const double lift = share * (bend > most ? most : above);
        const double x = m[t] + n[t], y = m[ty] + n[ty], z = m[tz] + n[tz];
        const double length = std::sqrt(x * x + y * y + z * z);
        const double scale = length > 0.0 ? 1.0 / length : 0.0;
        const double dx = x * scale, dy = y * scale, dz = z * scale;
        visit(t, t, (a[t] + b[t]) / 2.0 + lift * dx, dx);
        visit(t, ty, (a[ty] + b[ty]) / 2.0 + lift * dy, dy);
        visit(t, tz, (a[tz] + b[tz]) / 2.0 + lift * dz, dz);
    }
}

// Places new vertices by the rows of the coarser level's.
struct Refinement {
    Rows places;
    Array<double> normals;
    double share;

    Refinement(const mr_level& level, int curvature, const double* rows)
        : places{rows, level.frames},
          normals(normals_of(places, level.vertices, level.faces, level.face_count)),
          share(curvature / 64.0) {}

    void place(const int32_t* edges, size_t edge_count, const double* scalars, double* out) const {
        const size_t frames = places.frames;
        for (size_t e = 0; e < edge_count; ++e, out += 3 * frames, scalars += frames) {
            double* __restrict place = out;
            const double* __restrict scalar = scalars;
            edge_frame(places, {normals.data(), frames}, edges + 2 * e, share,
                       [=](size_t t, size_t k, double middle, double direction) {
                           place[k] = middle + scalar[t] * direction;
                       });
        }
    }
};

// Rows written as frames x vertices x 3, each coordinate as origin + scale * coordinate where there is a placement.
class Frames {
public:
    Frames(const mr_frames& frames, size_t count, size_t vertices)
        : out_(frames), count_(count), vertices_(vertices), placed_(kRowBlock * 3 * count), wastes_(count, 0.0) {}

    void set(size_t first, const double* rows, size_t count) {
        for (size_t begin = 0; begin < count; begin += kRowBlock) {
            const size_t some = std::min(kRowBlock, count - begin);
            for (size_t v = 0; v < some; ++v) {
                place(rows + 3 * count_ * (begin + v), placed_.data() + 3 * count_ * v);
                if (v % 2 == 0) fetch(first + begin + v + kRowBlock);
            }
            for (size_t t = 0; t < count_; ++t) {
                const size_t at = 3 * (t * vertices_ + first + begin);
                if (out_.singles) turn(placed_.data() + t, some, out_.singles + at);
                else turn(placed_.data() + t, some, out_.positions + at);
            }
        }
    }
    bool are_finite() const {  // before they were placed
        return std::all_of(wastes_.begin(), wastes_.end(), [](double waste) { return waste == 0.0; });
    }

private:
    void place(const double* __restrict in, double* __restrict out) {
        const size_t frames = count_;
        double* __restrict wastes = wastes_.data();  // of numbers that are not finite: anything else times 0 is 0
        for (size_t t = 0; t < frames; ++t) wastes[t] += in[t] * 0.0 + in[t + frames] * 0.0 + in[t + 2 * frames] * 0.0;
        if (!out_.placement) {
            std::copy(in, in + 3 * frames, out);
            return;
        }
        const mr_placement p = *out_.placement;
        for (size_t t = 0; t < frames; ++t) {
            out[t] = p.origin[0] + p.scale * in[t];
            out[t + frames] = p.origin[1] + p.scale * in[t + frames];
            out[t + 2 * frames] = p.origin[2] + p.scale * in[t + 2 * frames];
        }
    }
    // Where a vertex goes in each frame: memory that is far away by then, and on its way while others are placed.
    void fetch(size_t vertex) const {
        if (vertex >= vertices_) return;
        for (size_t t = 0; t < count_; ++t) {
            const size_t at = 3 * (t * vertices_ + vertex);
            out_.singles ? will_write(out_.singles + at) : will_write(out_.positions + at);
        }
    }
    template <class Number>
    void turn(const double* __restrict in, size_t count, Number* __restrict out) const {
        for (size_t v = 0; v < count; ++v, in += 3 * count_, out += 3)
            for (size_t k = 0; k < 3; ++k) out[k] = static_cast<Number>(in[k * count_]);
    }

    mr_frames out_;
    size_t count_, vertices_;
    std::vector<double> placed_, wastes_;
};

// Calls visit(first edge, count, rows of scalars) for blocks of a level's edges.
template <class Visit>
void each_block(const mr_level& level, const double* scalars, Visit visit) {
    for (size_t e = 0; e < level.edge_count; e += kRowBlock)
        visit(e, std::min(kRowBlock, level.edge_count - e), scalars + e * level.frames);
}

// The scalars of a LayersLevel record, decoded block after block so that they need not go through memory.
class LevelScalars {
public:
    // Scalars of the frames from the first-th on. A status; the other calls are for MR_OK.
    int decode(const LayersLevel& record, const mr_level& level, size_t first = 0) {
        weights_.resize(static_cast<size_t>(level.starts[level.edge_count]));
        for (size_t e = 0; e < level.edge_count; ++e) {
            const int64_t begin = level.starts[e], end = level.starts[e + 1];
            const double weight = record.sibling_weight / (64.0 * static_cast<double>(end - begin));
            std::fill(weights_.begin() + begin, weights_.begin() + end, weight);
        }
        const mr_graph graph{level.edge_count, level.starts, level.near, weights_.data()};
        const int status = decode_streams(record.scalars, graph, level.frames, 0, streams_);
        if (status != MR_OK) return status;
        if (record.origin == Origin::PREVIOUS && !level.previous) return MR_NO_PREVIOUS;
        field_ = streams_.over(graph, first);
        field_.before = record.origin == Origin::PREVIOUS ? level.previous : nullptr;
        return MR_OK;
    }

    // Calls visit(first edge, count, rows of scalars); `last` gets the scalars of the last frame.
    template <class Visit>
    void each_block(double* last, Visit visit) const {
        FieldRows values(field_);
        const size_t frames = field_.width, edge_count = field_.graph.count;
        std::vector<double> scalars(kRowBlock * frames);
        for (size_t e = 0; e < edge_count; e += kRowBlock) {
            const size_t count = std::min(kRowBlock, edge_count - e);
            values.next(count, scalars.data());
            for (size_t k = 0; k < count; ++k) last[e + k] = scalars[(k + 1) * frames - 1];
            visit(e, count, scalars.data());
        }
    }

private:
    Array<double> weights_;
    FieldStreams streams_;
    Field field_{};
};

bool is_good(const mr_level& level) {
    return in_range(level.faces, 3 * level.face_count, level.vertices) &&
           in_range(level.edges, 2 * level.edge_count, level.vertices);
}

// The arrays of a level and a record of it; MR_OK where both can be used.
int open_level(const mr_bytes& bytes, const mr_level& level, LayersLevel& record) {
    const int64_t links = level.starts[level.edge_count];
    if (!is_good(level) || level.frames == 0) return MR_BAD_INPUT;
    if (!is_causal(level.edge_count, level.starts, level.near, links)) return MR_NOT_CAUSAL;
    return parse(bytes, record) ? MR_OK : MR_BAD_RECORD;
}

// All of a finer level as frames; `each(visit)` visits its blocks of scalars.
template <class Each>
int refine_to_frames(const mr_level& level, const Refinement& refinement, const mr_frames& frames, Each each) {
    std::vector<double> some(kRowBlock * 3 * level.frames);
    Frames out(frames, level.frames, level.vertices + level.edge_count);
    out.set(0, refinement.places.data, level.vertices);
    each([&](size_t e, size_t count, const double* scalars) {
        refinement.place(level.edges + 2 * e, count, scalars, some.data());
        out.set(level.vertices + e, some.data(), count);
    });
    return out.are_finite() ? MR_OK : MR_NOT_FINITE;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_edge_frames(const mr_level* level, const double* positions, int curvature, double* midpoints,
                   double* directions) {
    if (!is_good(*level) || level->frames != 1) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        return wide([&] {
            const Refinement refinement(*level, curvature, positions);
            for (size_t e = 0; e < level->edge_count; ++e)
                edge_frame(refinement.places, {refinement.normals.data(), 1}, level->edges + 2 * e, refinement.share,
                           [=](size_t, size_t k, double middle, double direction) {
                               midpoints[3 * e + k] = middle;
                               directions[3 * e + k] = direction;
                           });
            return int{MR_OK};
        });
    });
}

int mr_refine(const mr_level* level, const double* rows, int curvature, const double* scalars,
              const mr_frames* frames) {
    if (!is_good(*level)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        return wide([&] {
            const Refinement refinement(*level, curvature, rows);
            return refine_to_frames(*level, refinement, *frames,
                                    [&](auto visit) { each_block(*level, scalars, visit); });
        });
    });
}

int mr_decode_level(const mr_bytes* bytes, const mr_level* level, double* rows, double* last) {
    LayersLevel record;
    int status = open_level(*bytes, *level, record);
    if (status != MR_OK) return status;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        LevelScalars scalars;
        status = scalars.decode(record, *level);
        if (status != MR_OK) return status;
        return wide([&] {
            const Refinement refinement(*level, record.curvature, rows);
            double* finer = rows + 3 * level->frames * level->vertices;
            scalars.each_block(last, [&](size_t e, size_t count, const double* block) {
                refinement.place(level->edges + 2 * e, count, block, finer + 3 * level->frames * e);
            });
            return int{MR_OK};
        });
    });
}

int mr_decode_last_level(const mr_bytes* bytes, const mr_level* level, const double* rows, double* last,
                         const mr_frames* frames) {
    LayersLevel record;
    int status = open_level(*bytes, *level, record);
    if (status != MR_OK) return status;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        LevelScalars scalars;
        status = scalars.decode(record, *level);
        if (status != MR_OK) return status;
        return wide([&] {
            const Refinement refinement(*level, record.curvature, rows);
            return refine_to_frames(*level, refinement, *frames, [&](auto visit) { scalars.each_block(last, visit); });
        });
    });
}

int mr_decode_last_scalars(const mr_bytes* bytes, const mr_level* level, double* last) {
    LayersLevel record;
    int status = open_level(*bytes, *level, record);
    if (status != MR_OK) return status;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        LevelScalars scalars;
        status = scalars.decode(record, *level, level->frames - 1);
        if (status == MR_OK) scalars.each_block(last, [](size_t, size_t, const double*) {});
        return status;
    });
}

int mr_frames_of_rows(const double* rows, size_t count, size_t vertices, const mr_frames* frames) {
    return guarded(MR_NO_MEMORY, [&] {
        Frames out(*frames, count, vertices);
        out.set(0, rows, vertices);
        return out.are_finite() ? int{MR_OK} : int{MR_NOT_FINITE};
    });
}
