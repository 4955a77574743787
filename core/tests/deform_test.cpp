#include "meshreel/deform.h"

#include "check.h"
#include "surfaces.h"

namespace {

constexpr double kCos = 0.9950041652780258, kSin = 0.09983341664682815;  // of 0.1 rad
constexpr double kShift[3] = {0.03, -0.02, 0.01};

void carry(double* p) {  // about z, and further
    const double x = p[0], y = p[1];
    p[0] = kCos * x - kSin * y + kShift[0], p[1] = kSin * x + kCos * y + kShift[1], p[2] += kShift[2];
}

// An ellipsoid, whose every vertex is a sample, with the vertices of an octahedron as nodes that move it.
struct Body {
    Body() {
        for (size_t k = 0; k < mesh.positions.size(); ++k) mesh.positions[k] *= axes[k % 3];
        nodes.assign(mesh.positions.begin(), mesh.positions.begin() + 18);  // the first vertices of a sphere
        for (size_t k = 0; k < normals.size(); ++k) normals[k] /= axes[k % 3];
        for (size_t v = 0; v < mesh.vertices(); ++v) {
            const double size = radius_of(&normals[3 * v]);
            for (size_t k = 0; k < 3; ++k) normals[3 * v + k] /= size;
            for (int32_t n = 0; n < 6; ++n) bound.push_back(n);
        }
        weights.assign(bound.size(), 1.0 / 6);
        for (int32_t i = 0; i < 6; ++i)
            for (int32_t j = 0; j < 6; ++j)
                if (i != j) edges.insert(edges.end(), {i, j});
        held.assign(edges.size() / 2, 1.0);
        for (int n = 0; n < 6; ++n) rotations.insert(rotations.end(), {1, 0, 0, 0, 1, 0, 0, 0, 1});
        positions = nodes;
    }

    int deform(const mr_seen& frame, double gate) {
        const std::vector<double> gates(12, gate), rigidity(12, 1.0);
        const mr_deformation graph{nodes.data(),
                                   6,
                                   edges.data(),
                                   held.size(),
                                   held.data(),
                                   mesh.positions.data(),
                                   normals.data(),
                                   mesh.vertices(),
                                   bound.data(),
                                   weights.data(),
                                   6};
        const mr_deform_rounds rounds{12, gates.data(), rigidity.data(), 0.5, 0.01, 0.3, 1e-6, 200};
        return mr_deform(&graph, &frame, &rounds, rotations.data(), positions.data());
    }

    const double axes[3] = {1.0, 0.6, 0.8};
    Shape mesh = sphere(3, 1.0);
    std::vector<double> normals = mesh.positions, nodes, held, weights, rotations, positions;
    std::vector<int32_t> edges, bound;
};

// The body after the motion, with its vertices as samples.
struct Moved : Frame {
    explicit Moved(const Body& body) : Frame(body.mesh) {
        normals = body.normals;
        for (size_t v = 0; v < shape.vertices(); ++v) {
            carry(&shape.positions[3 * v]);
            carry(&normals[3 * v]);
            for (size_t k = 0; k < 3; ++k) normals[3 * v + k] -= kShift[k];
        }
        mr_tree_move(tree, shape.positions.data());
    }
    mr_seen view() const {
        return {shape.view(),           tree,           normals.data(),   inside.data(),
                shape.positions.data(), normals.data(), shape.vertices(), 0.1};
    }
};

}  // namespace

TEST(a_rigid_motion_is_found) {
    Body body;
    const Moved frame(body);
    CHECK(body.deform(frame.view(), 0.5) == MR_OK);
    const double turn[9] = {kCos, -kSin, 0, kSin, kCos, 0, 0, 0, 1};
    for (size_t n = 0; n < 6; ++n) {
        for (size_t k = 0; k < 9; ++k) CHECK(std::fabs(body.rotations[9 * n + k] - turn[k]) < 1e-3);
        carry(&body.nodes[3 * n]);
        for (size_t k = 0; k < 3; ++k) CHECK(std::fabs(body.positions[3 * n + k] - body.nodes[3 * n + k]) < 1e-3);
    }
}

TEST(deformations_refuse_gates_nodes_and_faces_out_of_range) {
    Body body;
    Moved frame(body);
    CHECK(body.deform(frame.view(), 0.0) == MR_BAD_INPUT && body.positions == body.nodes);
    for (std::vector<int32_t>* indices : {&body.edges, &body.bound, &frame.shape.faces})
        for (int32_t wrong : {-1, static_cast<int32_t>(body.mesh.vertices())}) {
            const int32_t right = (*indices)[1];
            (*indices)[1] = wrong;
            CHECK(body.deform(frame.view(), 0.5) == MR_BAD_INPUT);
            (*indices)[1] = right;
        }
}
