// Edges wait in a queue with the versions of their ends; an entry whose end has changed since then is out of date. The
// corners of the faces at a vertex are a list through `next_`, so that two vertices are merged by joining their lists.
#include <algorithm>
#include <cmath>
#include <queue>
#include <utility>
#include <vector>

#include "arrays.h"
#include "guarded.h"
#include "meshreel/decimate.h"
#include "rigid3.h"

namespace meshreel {
namespace {

// Squared sine of an angle: thinner faces are lines, whose border would have no weight (guess).
constexpr double kNeedle = 1e-10;
constexpr double kFlat = 1e-3;  // of the cubed mean of the diagonal: determinants below leave a direction open (guess)

// The sum of squared distances from weighted planes: p A p + 2 b p + c.
struct Quadric {
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    Vec b{};
    double c = 0;

    void add_plane(Vec unit, Vec through, double weight) {
        const double d = -dot(unit, through);
        xx += weight * unit.x * unit.x, xy += weight * unit.x * unit.y, xz += weight * unit.x * unit.z;
        yy += weight * unit.y * unit.y, yz += weight * unit.y * unit.z, zz += weight * unit.z * unit.z;
        b = b + (weight * d) * unit;
        c += weight * d * d;
    }
    void add(const Quadric& other) {
        xx += other.xx, xy += other.xy, xz += other.xz, yy += other.yy, yz += other.yz, zz += other.zz;
        b = b + other.b;
        c += other.c;
    }
    double at(Vec p) const {
        const Vec square{xx * p.x + xy * p.y + xz * p.z, xy * p.x + yy * p.y + yz * p.z,
                         xz * p.x + yz * p.y + zz * p.z};
        return std::max(dot(square + 2 * b, p) + c, 0.0);
    }
    // Sets the point with the least sum; false where no single point has it.
    bool least(Vec& p) const {
        const double x = yy * zz - yz * yz, y = xz * yz - xy * zz, z = xy * yz - xz * yy;
        const double determinant = xx * x + xy * y + xz * z, mean = (xx + yy + zz) / 3;
        if (!(determinant > kFlat * mean * mean * mean)) return false;
        const double ww = xx * zz - xz * xz, wz = xy * xz - xx * yz, vv = xx * yy - xy * xy;
        p = {-(x * b.x + y * b.y + z * b.z) / determinant, -(y * b.x + ww * b.y + wz * b.z) / determinant,
             -(z * b.x + wz * b.y + vv * b.z) / determinant};
        return true;
    }
};

class Decimation {
public:
    Decimation(const mr_mesh& mesh, double border)
        : faces_(mesh.faces, mesh.faces + 3 * mesh.face_count),
          left_(mesh.face_count),
          next_(faces_.size(), -1),
          first_(mesh.vertices, -1),
          last_(mesh.vertices, -1),
          versions_(mesh.vertices, 0),
          quadrics_(mesh.vertices) {
        positions_.resize(mesh.vertices);
        for (size_t v = 0; v < mesh.vertices; ++v) positions_[v] = load(mesh.positions + 3 * v);
        for (size_t slot = 0; slot < faces_.size(); ++slot) append(faces_[slot], static_cast<int32_t>(slot));
        for (size_t f = 0; f < left_; ++f) add_planes(f, border);
        for (int32_t v = 0; v < static_cast<int32_t>(mesh.vertices); ++v) {
            for (const int32_t other : around(v))
                if (v < other) offer(v, other);
        }
    }

    void run(size_t wanted) {
        while (left_ > wanted && !queue_.empty()) {
            const Entry entry = queue_.top();
            queue_.pop();
            if (versions_[at(entry.a)] == entry.version_a && versions_[at(entry.b)] == entry.version_b)
                collapse(entry.a, entry.b);
        }
    }

    void write(mr_rest& rest) const {
        std::vector<int32_t> numbers(positions_.size(), -1);
        rest.vertices = rest.face_count = 0;
        for (size_t f = 0; 3 * f < faces_.size(); ++f) {
            if (faces_[3 * f] < 0) continue;
            for (size_t k = 0; k < 3; ++k) numbers[at(faces_[3 * f + k])] = 0;
        }
        for (size_t v = 0; v < numbers.size(); ++v) {
            if (numbers[v] < 0) continue;
            store(rest.positions + 3 * rest.vertices, positions_[v]);
            numbers[v] = static_cast<int32_t>(rest.vertices++);
        }
        for (size_t f = 0; 3 * f < faces_.size(); ++f) {
            if (faces_[3 * f] < 0) continue;
            for (size_t k = 0; k < 3; ++k) rest.faces[3 * rest.face_count + k] = numbers[at(faces_[3 * f + k])];
            ++rest.face_count;
        }
    }

private:
    struct Entry {
        double cost, length;  // the latter squared: on flat surface nothing costs, and one vertex would take in all
        int32_t a, b;         // ends, a < b
        uint32_t version_a, version_b;

        bool operator<(const Entry& other) const {  // the queue's top is the largest
            if (cost != other.cost) return cost > other.cost;
            if (length != other.length) return length > other.length;
            return a != other.a ? a > other.a : b > other.b;
        }
    };

    static size_t at(int32_t number) { return static_cast<size_t>(number); }
    Vec corner(size_t f, size_t k) const { return positions_[at(faces_[3 * f + k % 3])]; }

    void append(int32_t v, int32_t slot) {
        if (first_[at(v)] < 0) first_[at(v)] = slot;
        else next_[at(last_[at(v)])] = slot;
        last_[at(v)] = slot;
    }

    // The other vertices of the faces at a vertex, each once, in ascending order.
    const std::vector<int32_t>& around(int32_t v) {
        around_.clear();
        for (int32_t slot = first_[at(v)]; slot >= 0; slot = next_[at(slot)]) {
            const size_t f = at(slot) / 3;
            for (size_t k = 0; k < 3 && faces_[3 * f] >= 0; ++k)
                if (faces_[3 * f + k] != v) around_.push_back(faces_[3 * f + k]);
        }
        std::sort(around_.begin(), around_.end());
        around_.erase(std::unique(around_.begin(), around_.end()), around_.end());
        return around_;
    }

    bool is_border(int32_t a, int32_t b) const {
        int faces = 0;
        for (int32_t slot = first_[at(a)]; slot >= 0; slot = next_[at(slot)]) {
            const int32_t* face = &faces_[at(slot) / 3 * 3];
            faces += face[0] == b || face[1] == b || face[2] == b;
        }
        return faces == 1;
    }

    void add_planes(size_t f, double border) {
        const Vec normal = cross(corner(f, 1) - corner(f, 0), corner(f, 2) - corner(f, 0));
        const double length = std::sqrt(dot(normal, normal));
        if (!(length > 0)) return;
        const Vec unit{normal.x / length, normal.y / length, normal.z / length};
        for (size_t k = 0; k < 3; ++k) {
            const int32_t a = faces_[3 * f + k], b = faces_[3 * f + (k + 1) % 3];
            quadrics_[at(a)].add_plane(unit, corner(f, 0), length / 2);
            if (!is_border(a, b)) continue;
            const Vec along = positions_[at(b)] - positions_[at(a)], out = cross(along, unit);
            const double side = std::sqrt(dot(out, out));
            if (!(side > 0)) continue;
            const Vec upright{out.x / side, out.y / side, out.z / side};
            for (const int32_t end : {a, b})
                quadrics_[at(end)].add_plane(upright, positions_[at(a)], border * length / 2);
        }
    }

    // The place of what two vertices become, and what that costs.
    std::pair<double, Vec> merged(int32_t a, int32_t b) const {
        Quadric sum = quadrics_[at(a)];
        sum.add(quadrics_[at(b)]);
        const Vec p = positions_[at(a)], q = positions_[at(b)];
        Vec best = 0.5 * (p + q);
        if (sum.least(best)) return {sum.at(best), best};
        double least = sum.at(best);
        for (const Vec end : {p, q})
            if (const double cost = sum.at(end); cost < least) least = cost, best = end;
        return {least, best};
    }

    void offer(int32_t a, int32_t b) {
        if (a > b) std::swap(a, b);
        const Vec way = positions_[at(b)] - positions_[at(a)];
        queue_.push({merged(a, b).first, dot(way, way), a, b, versions_[at(a)], versions_[at(b)]});
    }

    // Whether a face of `v` that `other` has not would turn over, or become a line, if `v` were at a place.
    bool turns_over(int32_t v, int32_t other, Vec place) const {
        for (int32_t slot = first_[at(v)]; slot >= 0; slot = next_[at(slot)]) {
            const size_t f = at(slot) / 3, k = at(slot) % 3;
            const int32_t* face = &faces_[3 * f];
            if (face[0] < 0 || face[0] == other || face[1] == other || face[2] == other) continue;
            const Vec b = corner(f, k + 1), c = corner(f, k + 2);
            const Vec before = cross(b - corner(f, k), c - corner(f, k)), after = cross(b - place, c - place);
            if (dot(before, after) <= 0) return true;
            if (dot(after, after) < kNeedle * dot(b - place, b - place) * dot(c - place, c - place)) return true;
        }
        return false;
    }

    void collapse(int32_t a, int32_t b) {
        const Vec place = merged(a, b).second;
        if (turns_over(a, b, place) || turns_over(b, a, place)) return;
        for (int32_t slot = first_[at(b)]; slot >= 0; slot = next_[at(slot)]) {
            int32_t* face = &faces_[at(slot) / 3 * 3];
            if (face[0] < 0) continue;
            if (face[0] == a || face[1] == a || face[2] == a) face[0] = -1, --left_;
            else faces_[at(slot)] = a;
        }
        next_[at(last_[at(a)])] = first_[at(b)];
        last_[at(a)] = last_[at(b)];
        first_[at(b)] = -1;
        positions_[at(a)] = place;
        quadrics_[at(a)].add(quadrics_[at(b)]);
        ++versions_[at(a)], ++versions_[at(b)];
        for (const int32_t other : around(a)) offer(a, other);
    }

    std::vector<int32_t> faces_;  // the first corner of a face that is gone is -1
    size_t left_;
    std::vector<int32_t> next_, first_, last_;  // corners of faces: after each; of each vertex
    std::vector<uint32_t> versions_;
    std::vector<Quadric> quadrics_;
    std::vector<Vec> positions_;
    std::vector<int32_t> around_;
    std::priority_queue<Entry> queue_;
};

}  // namespace
}  // namespace meshreel

using namespace meshreel;

int mr_decimate(const mr_mesh* mesh, size_t faces, double border, mr_rest* rest) {
    if (mesh->vertices > INT32_MAX || mesh->face_count > INT32_MAX / 3 ||
        !in_range(mesh->faces, 3 * mesh->face_count, mesh->vertices))
        return MR_BAD_INPUT;
    return guarded(MR_NO_MEMORY, [&] {
        Decimation decimation(*mesh, border);
        decimation.run(faces);
        decimation.write(*rest);
        return int{MR_OK};
    });
}
