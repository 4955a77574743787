#include "meshreel/places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "arrays.h"
#include "guarded.h"

namespace meshreel {
namespace {

constexpr double kFarthest = 1 << 20;  // a place; sums and differences of such numbers are exact
constexpr size_t kNone = SIZE_MAX;

struct Place {
    int32_t u, v;
    bool operator==(const Place& other) const { return u == other.u && v == other.v; }
};

// The face beyond each side of each face, kNone for none; an edge of more than two faces joins the first two.
std::vector<size_t> faces_beyond(const mr_mesh& mesh) {
    struct Side {
        int32_t low, high;
        size_t side;
        bool operator<(const Side& other) const {
            if (low != other.low) return low < other.low;
            return high != other.high ? high < other.high : side < other.side;
        }
    };
    std::vector<Side> sides;
    sides.reserve(3 * mesh.face_count);
    for (size_t f = 0; f < mesh.face_count; ++f)
        for (size_t k = 0; k < 3; ++k) {
            const int32_t a = mesh.faces[3 * f + k], b = mesh.faces[3 * f + (k + 1) % 3];
            if (a != b) sides.push_back({std::min(a, b), std::max(a, b), 3 * f + k});
        }
    std::sort(sides.begin(), sides.end());
    std::vector<size_t> beyond(3 * mesh.face_count, kNone);
    for (size_t s = 1; s < sides.size(); ++s) {
        const Side &one = sides[s - 1], &two = sides[s];
        const bool is_first = s < 2 || sides[s - 2].low != one.low || sides[s - 2].high != one.high;
        if (!is_first || one.low != two.low || one.high != two.high || one.side / 3 == two.side / 3) continue;
        beyond[one.side] = two.side / 3;
        beyond[two.side] = one.side / 3;
    }
    return beyond;
}

int32_t rounded(double x) {
    const double whole = std::floor(x + 0.5);
    return whole > -kFarthest && whole < kFarthest ? static_cast<int32_t>(whole) : 0;
}

// Follows the faces of a mesh; `Symbols` reads or writes what cannot be predicted. False where it has come to its end.
template <class Symbols>
class Walk {
public:
    Walk(const mr_mesh& mesh, Place* places, Symbols& symbols)
        : mesh_(mesh),
          places_(places),
          symbols_(symbols),
          beyond_(faces_beyond(mesh)),
          chart_(mesh.face_count, kNone),
          at_vertex_(mesh.vertices, kNone) {}

    bool run() {
        Place last{0, 0};
        std::vector<size_t> queue;
        for (size_t first = 0; first < mesh_.face_count; ++first) {
            if (chart_[first] != kNone) continue;
            for (size_t k = 0; k < 3; ++k) {
                if (!symbols_.start(places_[3 * first + k], last)) return false;
                last = places_[3 * first + k];
            }
            queue.assign(1, first);
            settle(first, first);
            for (size_t at = 0; at < queue.size(); ++at)
                for (size_t k = 0; k < 3; ++k) {
                    const size_t f = beyond_[3 * queue[at] + k];
                    if (f == kNone || chart_[f] != kNone) continue;
                    bool joined = false;
                    if (!enter(queue[at], k, f, joined)) return false;
                    if (!joined) continue;
                    settle(f, first);
                    queue.push_back(f);
                }
        }
        return true;
    }

private:
    int32_t vertex(size_t f, size_t k) const { return mesh_.faces[3 * f + k]; }
    size_t corner_of(size_t f, int32_t v) const { return vertex(f, 0) == v ? 0 : vertex(f, 1) == v ? 1 : 2; }

    void settle(size_t f, size_t chart) {
        chart_[f] = chart;
        for (size_t k = 0; k < 3; ++k) at_vertex_[static_cast<size_t>(vertex(f, k))] = 3 * f + k;
    }

    // From face g over its k-th side to face f.
    bool enter(size_t g, size_t k, size_t f, bool& joined) {
        const size_t next = (k + 1) % 3, a = corner_of(f, vertex(g, k)), b = corner_of(f, vertex(g, next));
        const size_t c = 3 - a - b;
        const Place p = places_[3 * g + k], q = places_[3 * g + next];
        if (!symbols_.join(joined, places_[3 * f + a], p, places_[3 * f + b], q)) return false;
        if (!joined) return true;
        const size_t known = at_vertex_[static_cast<size_t>(vertex(f, c))];
        if (known != kNone && chart_[known / 3] == chart_[g]) {
            bool same = false;
            if (!symbols_.same(same, places_[3 * f + c], places_[known])) return false;
            if (same) return true;
        }
        return symbols_.rest(places_[3 * f + c], predicted(g, k, f, c));
    }

    // Place of the third corner of f if f has the same shape on the texture as in space.
    Place predicted(size_t g, size_t k, size_t f, size_t c) const {
        const Place p = places_[3 * g + k], q = places_[3 * g + (k + 1) % 3], r = places_[3 * g + (k + 2) % 3];
        const double *a = at(vertex(g, k)), *b = at(vertex(g, (k + 1) % 3)), *d = at(vertex(f, c));
        std::array<double, 3> e{b[0] - a[0], b[1] - a[1], b[2] - a[2]}, w{d[0] - a[0], d[1] - a[1], d[2] - a[2]};
        const double square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        if (!(square > 0)) return p;
        const double x = (w[0] * e[0] + w[1] * e[1] + w[2] * e[2]) / square;
        const double nx = w[1] * e[2] - w[2] * e[1], ny = w[2] * e[0] - w[0] * e[2], nz = w[0] * e[1] - w[1] * e[0];
        const double above = std::sqrt(nx * nx + ny * ny + nz * nz) / square;
        const double eu = q.u - p.u, ev = q.v - p.v;
        const double y = eu * (r.v - p.v) - ev * (r.u - p.u) > 0 ? -above : above;  // on the other side than g
        return {rounded(p.u + x * eu - y * ev), rounded(p.v + x * ev + y * eu)};
    }

    const double* at(int32_t v) const { return mesh_.positions + 3 * static_cast<size_t>(v); }

    const mr_mesh& mesh_;
    Place* places_;
    Symbols& symbols_;
    std::vector<size_t> beyond_, chart_, at_vertex_;
};

struct Writer {
    mr_place_symbols& out;

    bool start(const Place& place, const Place& last) {
        out.starts[out.start_count++] = place.u - last.u;
        out.starts[out.start_count++] = place.v - last.v;
        return true;
    }
    bool join(bool& joined, const Place& one, const Place& first, const Place& two, const Place& second) {
        joined = one == first && two == second;
        out.joins[out.join_count++] = joined;
        return true;
    }
    bool same(bool& equal, const Place& place, const Place& known) {
        equal = place == known;
        out.joins[out.join_count++] = equal;
        return true;
    }
    bool rest(const Place& place, const Place& predicted) {
        out.rests[out.rest_count++] = place.u - predicted.u;
        out.rests[out.rest_count++] = place.v - predicted.v;
        return true;
    }
};

struct Reader {
    const mr_place_symbols& in;
    size_t joins = 0, starts = 0, rests = 0;

    bool start(Place& place, const Place& last) {
        if (in.start_count - starts < 2) return false;
        starts += 2;
        return sum(last, in.starts + starts - 2, place);
    }
    bool join(bool& joined, Place& one, const Place& first, Place& two, const Place& second) {
        if (joins == in.join_count) return false;
        joined = in.joins[joins++] != 0;
        if (joined) one = first, two = second;
        return true;
    }
    bool same(bool& equal, Place& place, const Place& known) {
        if (joins == in.join_count) return false;
        equal = in.joins[joins++] != 0;
        if (equal) place = known;
        return true;
    }
    bool rest(Place& place, const Place& predicted) {
        if (in.rest_count - rests < 2) return false;
        rests += 2;
        return sum(predicted, in.rests + rests - 2, place);
    }
    bool is_done() const { return joins == in.join_count && starts == in.start_count && rests == in.rest_count; }

private:
    static bool sum(const Place& from, const int32_t* more, Place& place) {
        const double u = static_cast<double>(from.u) + more[0], v = static_cast<double>(from.v) + more[1];
        if (!(std::fabs(u) < kFarthest && std::fabs(v) < kFarthest)) return false;
        place = {static_cast<int32_t>(u), static_cast<int32_t>(v)};
        return true;
    }
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_encode_places(const mr_mesh* mesh, const int32_t* places, mr_place_symbols* symbols) {
    if (!in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<Place> copy(3 * mesh->face_count);
        for (size_t k = 0; k < copy.size(); ++k) {
            copy[k] = {places[2 * k], places[2 * k + 1]};
            for (double x : {static_cast<double>(copy[k].u), static_cast<double>(copy[k].v)})
                if (std::fabs(x) >= kFarthest) return MR_BAD_INPUT;
        }
        symbols->join_count = symbols->start_count = symbols->rest_count = 0;
        Writer writer{*symbols};
        Walk<Writer>(*mesh, copy.data(), writer).run();
        return MR_OK;
    });
}

int mr_decode_places(const mr_mesh* mesh, const mr_place_symbols* symbols, int32_t* places) {
    if (!in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices)) return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&]() -> int {
        std::vector<Place> found(3 * mesh->face_count);
        Reader reader{*symbols};
        if (!Walk<Reader>(*mesh, found.data(), reader).run() || !reader.is_done()) return MR_BAD_RECORD;
        for (size_t k = 0; k < found.size(); ++k) places[2 * k] = found[k].u, places[2 * k + 1] = found[k].v;
        return MR_OK;
    });
}
