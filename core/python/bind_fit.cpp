#include "meshreel/fit.h"

#include <vector>

#include "trees.h"

namespace meshreel {
namespace {

using namespace nb::literals;

// A frame that templates are fitted to; it holds the arrays that it refers to.
class FitTarget {
public:
    FitTarget(nb::object tree, In<double, 2> positions, In<int32_t, 2> faces, In<double, 2> normals,
              In<uint8_t, 1> inside, In<double, 2> points, In<double, 2> point_normals, In<double, 2> outward)
        : held_{tree,
                nb::cast(positions),
                nb::cast(faces),
                nb::cast(normals),
                nb::cast(inside),
                nb::cast(points),
                nb::cast(point_normals),
                nb::cast(outward)} {
        const size_t count = points.shape(0);
        expect(are_vectors(normals, positions.shape(0)) && inside.shape(0) == positions.shape(0));
        expect(are_vectors(points, count) && are_vectors(point_normals, count) && are_vectors(outward, count));
        target_ = {mesh_of(positions, faces),
                   nb::cast<const PySurfaceTree&>(tree).handle(),
                   normals.data(),
                   inside.data(),
                   {points.data(), point_normals.data(), outward.data(), count}};
    }

    const mr_target& view() const { return target_; }

private:
    std::vector<nb::object> held_;
    mr_target target_{};
};

class FitTemplate {
public:
    FitTemplate(In<int32_t, 2> faces, size_t vertices) : vertices_(vertices) {
        expect(faces.shape(1) == 3);
        mr_template* fitted = nullptr;
        check(mr_template_create(faces.data(), faces.shape(0), vertices, &fitted));
        fitted_.reset(fitted);
    }

    Out<double, 2> fit(const FitTarget& target, In<double, 2> rest, In<double, 2> place, In<double, 2> start,
                       In<double, 1> gates, In<double, 1> smoothing, In<int32_t, 1> strides, double agreement,
                       double anchor, double tolerance, int iterations, bool turn) {
        expect(are_vectors(rest, vertices_) && are_vectors(place, vertices_) && are_vectors(start, vertices_));
        expect(gates.shape(0) == smoothing.shape(0) && gates.shape(0) == strides.shape(0));
        const mr_fit_rounds rounds{gates.shape(0), gates.data(), smoothing.data(),
                                   strides.data(), agreement,    anchor,
                                   tolerance,      iterations,   turn};
        Buffer<double> positions(start.data(), 3 * vertices_);
        check(without_gil([&] {
            return mr_fit(fitted_.get(), &target.view(), &rounds, rest.data(), place.data(), positions.data());
        }));
        return positions.shaped(vertices_, 3);
    }

    Out<double, 2> turned_laplacian(In<double, 2> rest, In<double, 2> now) const {
        expect(are_vectors(rest, vertices_) && are_vectors(now, vertices_));
        Buffer<double> shape(3 * vertices_);
        check(without_gil([&] { return mr_turned_laplacian(fitted_.get(), rest.data(), now.data(), shape.data()); }));
        return shape.shaped(vertices_, 3);
    }

private:
    size_t vertices_;
    std::unique_ptr<mr_template, Destroy<mr_template, mr_template_destroy>> fitted_;
};

}  // namespace

void bind_fit(nb::module_& m) {
    nb::class_<PySurfaceTree>(m, "SurfaceTree", "A mesh with at least one face, prepared for closest points and rays.")
        .def(nb::init<In<double, 2>, In<int32_t, 2>>(), "positions"_a, "faces"_a)
        .def("move", &PySurfaceTree::move, "positions"_a, "Gives the vertices other positions.")
        .def("closest", &PySurfaceTree::closest, "queries"_a, "reach"_a, "guesses"_a = nb::none(),
             "gone"_a = nb::none(),
             "The closest face to each query, those that are gone left out, -1 where none is within reach, and the "
             "weights of its corners.")
        .def("cast", &PySurfaceTree::cast, "origins"_a, "ways"_a, "weighted"_a,
             "The first face that each ray meets, -1 for none, the distance in lengths of its way, and the weights of "
             "the corners there, if wanted. One origin is that of all rays.");
    nb::class_<FitTarget>(m, "FitTarget", "A frame prepared for fits, with samples on its open borders.")
        .def(nb::init<nb::object, In<double, 2>, In<int32_t, 2>, In<double, 2>, In<uint8_t, 1>, In<double, 2>,
                      In<double, 2>, In<double, 2>>(),
             "tree"_a, "positions"_a, "faces"_a, "normals"_a, "inside"_a, "points"_a, "point_normals"_a, "outward"_a);
    nb::class_<FitTemplate>(m, "FitTemplate", "Connectivity of a mesh that is fitted to frames.")
        .def(nb::init<In<int32_t, 2>, size_t>(), "faces"_a, "vertices"_a)
        .def("fit", &FitTemplate::fit, "target"_a, "rest"_a, "place"_a, "start"_a, "gates"_a, "smoothing"_a,
             "strides"_a, "agreement"_a, "anchor"_a, "tolerance"_a, "iterations"_a, "turn"_a,
             "The positions of a fit that begins at `start`, keeps the shape of `rest` and stays near `place`.")
        .def("turned_laplacian", &FitTemplate::turned_laplacian, "rest"_a, "now"_a,
             "Laplacian coordinates of `rest`, turned as each neighbourhood turns from `rest` to `now`.");
}

}  // namespace meshreel
