// Edges wait in a queue with the versions of their ends; an entry whose end has changed since then is out of date. The
// corners of the faces at a vertex are a list through `next_`, so that two vertices are merged by joining their lists.
#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <utility>
#include <vector>

#include "arrays.h"
#include "guarded.h"
#include "meshreel/decimate.h"

namespace meshreel {
namespace {

using Vec3 = std::array<double, 3>;

constexpr double kFlat = 1e-3;  // of the cubed mean of the diagonal: determinants below leave a direction open (guess)

Vec3 operator-(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 cross(const Vec3& a, const Vec3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// The sum of squared distances from weighted planes: p A p + 2 b p + c.
struct Quadric {
    double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    Vec3 b{};
    double c = 0;

    void add_plane(const Vec3& unit, const Vec3& through, double weight) {
        const double d = -dot(unit, through);
        xx += weight * unit[0] * unit[0], xy += weight * unit[0] * unit[1], xz += weight * unit[0] * unit[2];
        yy += weight * unit[1] * unit[1], yz += weight * unit[1] * unit[2], zz += weight * unit[2] * unit[2];
        for (size_t k = 0; k < 3; ++k) b[k] += weight * d * unit[k];
        c += weight * d * d;
    }
    void add(const Quadric& other) {
        xx += other.xx, xy += other.xy, xz += other.xz, yy += other.yy, yz += other.yz, zz += other.zz;
        for (size_t k = 0; k < 3; ++k) b[k] += other.b[k];
        c += other.c;
    }
    double at(const Vec3& p) const {
        const double x = xx * p[0] + xy * p[1] + xz * p[2], y = xy * p[0] + yy * p[1] + yz * p[2],
                     z = xz * p[0] + yz * p[1] + zz * p[2];
        return std::max((x + 2 * b[0]) * p[0] + (y + 2 * b[1]) * p[1] + (z + 2 * b[2]) * p[2] + c, 0.0);
    }
    // Sets the point with the least sum; false where no single point has it.
    bool least(Vec3& p) const {
        const double x = yy * zz - yz * yz, y = xz * yz - xy * zz, z = xy * yz - xz * yy;
        const double determinant = xx * x + xy * y + xz * z, mean = (xx + yy + zz) / 3;
        if (!(determinant > kFlat * mean * mean * mean)) return false;
        const double ww = xx * zz - xz * xz, wz = xy * xz - xx * yz, vv = xx * yy - xy * xy;
        p = {-(x * b[0] + y * b[1] + z * b[2]) / determinant, -(y * b[0] + ww * b[1] + wz * b[2]) / determinant,
             -(z * b[0] + wz * b[1] + vv * b[2]) / determinant};
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
        for (size_t v = 0; v < mesh.vertices; ++v) std::copy_n(mesh.positions + 3 * v, 3, positions_[v].data());
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
            std::copy_n(positions_[v].data(), 3, rest.positions + 3 * rest.vertices);
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
        double cost;
        int32_t a, b;  // ends, a < b
        uint32_t version_a, version_b;

        bool operator<(const Entry& other) const {  // the queue's top is the largest
            if (cost != other.cost) return cost > other.cost;
            return a != other.a ? a > other.a : b > other.b;
        }
    };

    static size_t at(int32_t number) { return static_cast<size_t>(number); }
    const Vec3& corner(size_t f, size_t k) const { return positions_[at(faces_[3 * f + k % 3])]; }

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
        const Vec3 normal = cross(corner(f, 1) - corner(f, 0), corner(f, 2) - corner(f, 0));
        const double length = std::sqrt(dot(normal, normal));
        if (!(length > 0)) return;
        const Vec3 unit{normal[0] / length, normal[1] / length, normal[2] / length};
        for (size_t k = 0; k < 3; ++k) {
            const int32_t a = faces_[3 * f + k], b = faces_[3 * f + (k + 1) % 3];
            quadrics_[at(a)].add_plane(unit, corner(f, 0), length / 2);
            if (!is_border(a, b)) continue;
            const Vec3 along = positions_[at(b)] - positions_[at(a)], out = cross(along, unit);
            const double side = std::sqrt(dot(out, out));
            if (!(side > 0)) continue;
            const Vec3 upright{out[0] / side, out[1] / side, out[2] / side};
            for (const int32_t end : {a, b})
                quadrics_[at(end)].add_plane(upright, positions_[at(a)], border * length / 2);
        }
    }

    // The place of what two vertices become, and what that costs.
    std::pair<double, Vec3> merged(int32_t a, int32_t b) const {
        Quadric sum = quadrics_[at(a)];
        sum.add(quadrics_[at(b)]);
        const Vec3 &p = positions_[at(a)], &q = positions_[at(b)];
        Vec3 best{(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2};
        if (sum.least(best)) return {sum.at(best), best};
        double least = sum.at(best);
        for (const Vec3* end : {&p, &q})
            if (const double cost = sum.at(*end); cost < least) least = cost, best = *end;
        return {least, best};
    }

    void offer(int32_t a, int32_t b) {
        if (a > b) std::swap(a, b);
        queue_.push({merged(a, b).first, a, b, versions_[at(a)], versions_[at(b)]});
    }

    // Whether a face of `v` that `other` has not would turn over if `v` were at a place.
    bool turns_over(int32_t v, int32_t other, const Vec3& place) const {
        for (int32_t slot = first_[at(v)]; slot >= 0; slot = next_[at(slot)]) {
            const size_t f = at(slot) / 3, k = at(slot) % 3;
            const int32_t* face = &faces_[3 * f];
            if (face[0] < 0 || face[0] == other || face[1] == other || face[2] == other) continue;
            const Vec3 &b = corner(f, k + 1), &c = corner(f, k + 2);
            if (dot(cross(b - corner(f, k), c - corner(f, k)), cross(b - place, c - place)) <= 0) return true;
        }
        return false;
    }

    void collapse(int32_t a, int32_t b) {
        const Vec3 place = merged(a, b).second;
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
    std::vector<Vec3> positions_;
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
