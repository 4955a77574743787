// Rays through the tree of a surface. On which side of an edge a ray passes is decided by the same products for both
// faces of the edge, and with a little tolerance, so that no ray slips between faces.
#include <algorithm>
#include <cmath>
#include <limits>

#include "arrays.h"
#include "guarded.h"
#include "lanes.h"
#include "surface_tree.h"
#include "tree_handle.h"

namespace meshreel {
namespace {

constexpr int kWide = 4;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kSteepest = 1e18f;  // of the inverse of a direction's coordinate, so that 0 times it is 0
constexpr double kSlack = 1e-6;     // error of single precision, and more, in distances from the middle of the mesh
constexpr float kBeside = 4.0f * std::numeric_limits<float>::epsilon();  // weight by which a ray may pass a face
constexpr int kDeepest = 128;                                            // see surface_tree.cpp

struct Lanes3 {
    Lanes x, y, z;
};

Lanes3 operator-(const Lanes3& a, const Lanes3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Lanes3 operator+(const Lanes3& a, const Lanes3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Lanes dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Lanes3 cross(const Lanes3& a, const Lanes3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct Corners {  // of the four triangles of a block
    float at[3][3][kWide];
    Lanes3 corner(int k) const { return {load_lanes(at[k][0]), load_lanes(at[k][1]), load_lanes(at[k][2])}; }
};

float steep(float x) {
    const float inverse = 1.0f / x;
    return std::fabs(inverse) < kSteepest ? inverse : std::copysign(kSteepest, x);
}

struct Found {
    float distance = kInfinity;
    int32_t face = INT32_MAX;
};

class Ray {
public:
    // Boxes are taken to be larger by `slack`: a ray that meets a face by its edges may pass beside its box.
    Ray(Vec origin, Vec way, float slack) {
        const double from[3] = {origin.x, origin.y, origin.z}, along[3] = {way.x, way.y, way.z};
        for (int d = 0; d < 3; ++d) {
            from_[d] = lanes(static_cast<float>(from[d]));
            way_[d] = lanes(static_cast<float>(along[d]));
            const float inverse = steep(static_cast<float>(along[d]));
            inverse_[d] = lanes(inverse);
            back_[d] = inverse < 0.0f;
            from_low_[d] = from_[d] + lanes(slack);
            from_high_[d] = from_[d] - lanes(slack);
        }
    }

    // Distances at which the ray enters four boxes, infinite where it passes them.
    void enter(const float (*low)[kWide], const float (*high)[kWide], float* distances) const {
        Lanes near = lanes(0.0f), far = lanes(kInfinity);
        for (int d = 0; d < 3; ++d) {
            const Lanes to_low = (load_lanes(low[d]) - from_low_[d]) * inverse_[d];
            const Lanes to_high = (load_lanes(high[d]) - from_high_[d]) * inverse_[d];
            near = larger(near, back_[d] ? to_high : to_low);
            far = smaller(far, back_[d] ? to_low : to_high);
        }
        float ends[kWide];
        store_lanes(distances, near);
        store_lanes(ends, far);
        for (int k = 0; k < kWide; ++k)
            if (!(distances[k] <= ends[k])) distances[k] = kInfinity;
    }

    // The nearest face, of equally near ones that with the least number.
    void meet(const Corners& corners, const int32_t* faces, Found& found) const {
        const Lanes3 from{from_[0], from_[1], from_[2]}, way{way_[0], way_[1], way_[2]};
        const Lanes3 a = corners.corner(0) - from, b = corners.corner(1) - from, c = corners.corner(2) - from;
        const Lanes u = dot(cross(c - b, c + b), way), v = dot(cross(a - c, a + c), way);
        const Lanes w = dot(cross(b - a, b + a), way);
        const Lanes3 normal = cross(b - a, c - a);
        const Lanes across = dot(normal, way), ahead = dot(normal, a);
        const Lanes sum = u + v + w, beside = larger(sum, lanes(0.0f) - sum) * lanes(kBeside);
        const Lanes least = smaller(u, smaller(v, w)) + beside, most = larger(u, larger(v, w)) - beside;
        for (int k = 0; k < kWide; ++k) {
            if (least[k] < 0.0f && most[k] > 0.0f) continue;
            if (across[k] == 0.0f) continue;
            const float distance = ahead[k] / across[k];
            if (!(distance >= 0.0f) || distance > found.distance) continue;
            if (distance < found.distance || faces[k] < found.face) found = {distance, faces[k]};
        }
    }

private:
    Lanes from_[3], from_low_[3], from_high_[3], way_[3], inverse_[3];
    bool back_[3];
};

}  // namespace

void SurfaceTree::cast(const Rays& rays, int32_t* faces, double* distances, double* weights) const {
    std::vector<Corners> corners(blocks_.size());
    for (size_t n = 0; n < blocks_.size(); ++n)
        for (int lane = 0; lane < kWide; ++lane)
            for (int k = 0; k < 3; ++k) {
                const Vec p = corner(blocks_[n].face[lane], k);
                corners[n].at[k][0][lane] = static_cast<float>(p.x);
                corners[n].at[k][1][lane] = static_cast<float>(p.y);
                corners[n].at[k][2][lane] = static_cast<float>(p.z);
            }
    struct Waiting {
        float near;
        int32_t child;
    };
    Waiting stack[3 * kDeepest + kWide];
    int32_t before = 0;  // the block that the ray before this one met
    for (size_t r = 0; r < rays.count; ++r) {
        const Vec origin = load(rays.origins + (rays.one_origin ? 0 : 3 * r)) - origin_, way = load(rays.ways + 3 * r);
        const double slack = slack_ + kSlack * std::sqrt(meshreel::dot(origin, origin));
        const Ray ray(origin, way, static_cast<float>(slack));
        Found found;
        ray.meet(corners[static_cast<size_t>(before)], blocks_[static_cast<size_t>(before)].face, found);
        int size = 0;
        stack[size++] = {0.0f, root_};
        while (size > 0) {
            const Waiting next = stack[--size];
            if (!(next.near <= found.distance)) continue;
            if (next.child < 0) {
                const size_t block = static_cast<size_t>(~next.child);
                const int32_t face = found.face;
                ray.meet(corners[block], blocks_[block].face, found);
                if (found.face != face) before = static_cast<int32_t>(block);
                continue;
            }
            const Node& node = nodes_[static_cast<size_t>(next.child)];
            float near[kWide];
            ray.enter(node.low, node.high, near);
            const int first = size;
            for (int k = 0; k < kWide; ++k) {
                if (node.child[k] == kNothing || !(near[k] <= found.distance) || near[k] == kInfinity) continue;
                int at = size++;
                for (; at > first && stack[at - 1].near < near[k]; --at) stack[at] = stack[at - 1];
                stack[at] = {near[k], node.child[k]};
            }
        }
        faces[r] = found.face == INT32_MAX ? -1 : found.face;
        double unused[3];
        distances[r] = met(faces[r], origin, way, weights == nullptr ? unused : weights + 3 * r);
    }
}

// Distance at which a ray meets a face's plane, in double precision; infinite without a face.
double SurfaceTree::met(int32_t face, Vec origin, Vec way, double* weights) const {
    weights[0] = 1.0, weights[1] = weights[2] = 0.0;
    if (face < 0) return std::numeric_limits<double>::infinity();
    const Vec a = corner(face, 0) - origin, b = corner(face, 1) - origin, c = corner(face, 2) - origin;
    const double u = meshreel::dot(meshreel::cross(c - b, c + b), way);
    const double v = meshreel::dot(meshreel::cross(a - c, a + c), way);
    const double w = meshreel::dot(meshreel::cross(b - a, b + a), way), sum = u + v + w;
    const Vec normal = meshreel::cross(b - a, c - a);
    if (sum != 0.0) weights[0] = u / sum, weights[1] = v / sum, weights[2] = w / sum;
    return std::max(meshreel::dot(normal, a) / meshreel::dot(normal, way), 0.0);
}

}  // namespace meshreel

using namespace meshreel;

int mr_tree_cast(const mr_tree* tree, const mr_rays* rays, int32_t* faces, double* distances, double* weights) {
    return guarded(MR_NO_MEMORY, [&]() -> int {
        tree->tree.cast({rays->origins, rays->ways, rays->count, rays->one_origin != 0}, faces, distances, weights);
        return MR_OK;
    });
}
