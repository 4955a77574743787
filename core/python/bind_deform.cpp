#include "meshreel/deform.h"

#include <vector>

#include "trees.h"

namespace meshreel {
namespace {

using namespace nb::literals;

// A frame and samples of it; it holds the arrays that it refers to.
class DeformTarget {
public:
    DeformTarget(nb::object tree, In<double, 2> positions, In<int32_t, 2> faces, In<double, 2> normals,
                 In<uint8_t, 1> inside, In<double, 2> points, In<double, 2> point_normals, double spacing)
        : held_{tree,
                nb::cast(positions),
                nb::cast(faces),
                nb::cast(normals),
                nb::cast(inside),
                nb::cast(points),
                nb::cast(point_normals)} {
        const size_t count = points.shape(0);
        expect(are_vectors(normals, positions.shape(0)) && inside.shape(0) == positions.shape(0));
        expect(are_vectors(points, count) && are_vectors(point_normals, count));
        frame_ = {mesh_of(positions, faces),
                  nb::cast<const PySurfaceTree&>(tree).handle(),
                  normals.data(),
                  inside.data(),
                  points.data(),
                  point_normals.data(),
                  count,
                  spacing};
    }

    const mr_seen& view() const { return frame_; }

private:
    std::vector<nb::object> held_;
    mr_seen frame_{};
};

class Deformation {
public:
    Deformation(In<double, 2> nodes, In<int32_t, 2> edges, In<double, 1> held, In<double, 2> points,
                In<double, 2> normals, In<int32_t, 2> bound, In<double, 2> weights)
        : held_{nb::cast(nodes),   nb::cast(edges), nb::cast(held),   nb::cast(points),
                nb::cast(normals), nb::cast(bound), nb::cast(weights)} {
        const size_t count = points.shape(0);
        expect(are_vectors(nodes, nodes.shape(0)) && edges.shape(1) == 2 && held.shape(0) == edges.shape(0));
        expect(are_vectors(points, count) && are_vectors(normals, count) && bound.shape(0) == count);
        expect(weights.shape(0) == count && weights.shape(1) == bound.shape(1));
        graph_ = {nodes.data(),   nodes.shape(0), edges.data(), edges.shape(0), held.data(),   points.data(),
                  normals.data(), count,          bound.data(), weights.data(), bound.shape(1)};
    }

    nb::tuple deform(const DeformTarget& frame, In<double, 3> rotations, In<double, 2> positions, In<double, 1> gates,
                     In<double, 1> rigidity, double torn, double place, double agreement, double tolerance,
                     int iterations) const {
        check_pose(rotations, positions);
        expect(gates.shape(0) == rigidity.shape(0));
        const mr_deform_rounds rounds{gates.shape(0), gates.data(), rigidity.data(), torn,
                                      place,          agreement,    tolerance,       iterations};
        Buffer<double> turned(rotations.data(), rotations.size()), moved(positions.data(), positions.size());
        check(without_gil([&] { return mr_deform(&graph_, &frame.view(), &rounds, turned.data(), moved.data()); }));
        return nb::make_tuple(turned.shaped(graph_.node_count, 3, 3), moved.shaped(graph_.node_count, 3));
    }

    double matched(const DeformTarget& frame, In<double, 3> rotations, In<double, 2> positions, double gate,
                   double agreement) const {
        check_pose(rotations, positions);
        double sum = 0.0;
        check(without_gil([&] {
            return mr_deform_matched(&graph_, &frame.view(), gate, agreement, rotations.data(), positions.data(), &sum);
        }));
        return sum;
    }

    Out<double, 1> holds(In<double, 3> rotations, In<double, 2> positions, double torn) const {
        check_pose(rotations, positions);
        Buffer<double> out(graph_.edge_count);
        check(mr_deform_holds(&graph_, torn, rotations.data(), positions.data(), out.data()));
        return out.shaped(graph_.edge_count);
    }

private:
    void check_pose(const In<double, 3>& rotations, const In<double, 2>& positions) const {
        expect(rotations.shape(0) == graph_.node_count && rotations.shape(1) == 3 && rotations.shape(2) == 3);
        expect(are_vectors(positions, graph_.node_count));
    }

    std::vector<nb::object> held_;
    mr_deformation graph_{};
};

}  // namespace

void bind_deform(nb::module_& m) {
    nb::class_<DeformTarget>(m, "DeformTarget", "A frame that graphs are deformed to, with samples of it.")
        .def(nb::init<nb::object, In<double, 2>, In<int32_t, 2>, In<double, 2>, In<uint8_t, 1>, In<double, 2>,
                      In<double, 2>, double>(),
             "tree"_a, "positions"_a, "faces"_a, "normals"_a, "inside"_a, "points"_a, "point_normals"_a, "spacing"_a);
    nb::class_<Deformation>(m, "Deformation", "A deformation graph at rest, with samples that are bound to it.")
        .def(nb::init<In<double, 2>, In<int32_t, 2>, In<double, 1>, In<double, 2>, In<double, 2>, In<int32_t, 2>,
                      In<double, 2>>(),
             "nodes"_a, "edges"_a, "held"_a, "points"_a, "normals"_a, "bound"_a, "weights"_a)
        .def("deform", &Deformation::deform, "frame"_a, "rotations"_a, "positions"_a, "gates"_a, "rigidity"_a, "torn"_a,
             "place"_a, "agreement"_a, "tolerance"_a, "iterations"_a,
             "The pose after Gauss-Newton rounds towards a frame.")
        .def("matched", &Deformation::matched, "frame"_a, "rotations"_a, "positions"_a, "gate"_a, "agreement"_a,
             "The sum of the weights of all pairs at a pose.")
        .def("holds", &Deformation::holds, "rotations"_a, "positions"_a, "torn"_a,
             "The factor of each edge by how much a pose tears it.");
}

}  // namespace meshreel
