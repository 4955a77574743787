#include "meshreel/tracking.h"

#include "arrays.h"

namespace meshreel {
namespace {

using namespace nb::literals;

using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Output = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Rows9 = nb::ndarray<const double, nb::shape<-1, 9>, nb::c_contig, nb::device::cpu>;
using Output9 = nb::ndarray<double, nb::shape<-1, 9>, nb::c_contig, nb::device::cpu>;
using Reals = In<double, 1>;
using OutputReals = InOut<double, 1>;
using Indices = In<int32_t, 1>;
using OutputIndices = InOut<int32_t, 1>;

void require(bool condition, const char* what) {
    if (!condition) throw nb::value_error(what);
}

mr_neighbours lists(const Indices& offsets, const Indices& indices, const Reals& weights, size_t count) {
    require(offsets.shape(0) == count + 1 && indices.shape(0) == weights.shape(0),
            "tracking: neighbour lists of wrong length");
    require(offsets(count) == static_cast<int32_t>(indices.shape(0)),
            "tracking: the last offset must be the number of pairs");
    return {offsets.data(), indices.data(), weights.data()};
}

mr_relaxation problem_of(const Points& samples, double tolerance, int max_rounds, size_t centers) {
    mr_relaxation p{};
    p.samples = samples.data();
    p.sample_count = static_cast<int64_t>(samples.shape(0));
    p.center_count = static_cast<int64_t>(centers);
    p.spread = 1;
    p.tolerance = tolerance;
    p.max_rounds = max_rounds;
    return p;
}

nb::tuple spread_centers(Points samples, Output centers, OutputIndices owners, double tolerance, int max_rounds) {
    require(owners.shape(0) == samples.shape(0), "tracking: one owner a sample");
    const mr_relaxation p = problem_of(samples, tolerance, max_rounds, centers.shape(0));
    mr_relaxed r{centers.data(), nullptr, owners.data(), 0, 0};
    check(without_gil([&] { return mr_relax_centers(&p, &r); }));
    return nb::make_tuple(r.energy, r.rounds);
}

nb::tuple follow_centers(Points samples, Points previous, Indices offsets, Indices indices, Reals weights,
                         Output centers, Output9 rotations, OutputIndices owners, double spread, double rigidity,
                         double tolerance, int max_rounds) {
    const size_t count = centers.shape(0);
    require(owners.shape(0) == samples.shape(0), "tracking: one owner a sample");
    require(previous.shape(0) == count && rotations.shape(0) == count,
            "tracking: one previous place and one rotation a center");
    mr_relaxation p = problem_of(samples, tolerance, max_rounds, count);
    p.previous = previous.data();
    p.neighbours = lists(offsets, indices, weights, count);
    p.spread = spread;
    p.rigidity = rigidity;
    mr_relaxed r{centers.data(), rotations.data(), owners.data(), 0, 0};
    check(without_gil([&] { return mr_relax_centers(&p, &r); }));
    return nb::make_tuple(r.energy, r.rounds);
}

void motion_differences(Indices offsets, Indices indices, Rows9 rotations, Points shifts, Points means,
                        Rows9 covariances, OutputReals out) {
    const size_t count = shifts.shape(0);
    require(rotations.shape(0) == count && means.shape(0) == count && covariances.shape(0) == count,
            "tracking: one rotation, shift, mean and covariance a center");
    require(count > 0 && offsets.shape(0) == count + 1 && out.shape(0) == indices.shape(0) && offsets(0) == 0 &&
                offsets(count) == static_cast<int32_t>(indices.shape(0)),
            "tracking: neighbour lists of wrong length");
    for (size_t i = 0; i < count; ++i) require(offsets(i) <= offsets(i + 1), "tracking: offsets must not fall");
    const mr_neighbours n{offsets.data(), indices.data(), nullptr};
    check(mr_motion_differences(static_cast<int64_t>(count), &n, rotations.data(), shifts.data(), means.data(),
                                covariances.data(), out.data()));
}

}  // namespace

void bind_tracking(nb::module_& m) {
    m.def("spread_centers", &spread_centers, "samples"_a, "centers"_a, "owners"_a, "tolerance"_a, "max_rounds"_a,
          "Lloyd's relaxation of `centers` (in place) over `samples`; fills `owners`; gives (energy, rounds).");
    m.def("follow_centers", &follow_centers, "samples"_a, "previous"_a, "offsets"_a, "indices"_a, "weights"_a,
          "centers"_a, "rotations"_a, "owners"_a, "spread"_a, "rigidity"_a, "tolerance"_a, "max_rounds"_a,
          "Moves `centers` (in place) from `previous` into `samples`, evenly and as rigidly as possible; gives "
          "(energy, rounds).");
    m.def("motion_differences", &motion_differences, "offsets"_a, "indices"_a, "rotations"_a, "shifts"_a, "means"_a,
          "covariances"_a, "out"_a,
          "For each pair of the lists, how far apart the motions of both send what the first owns.");
}

}  // namespace meshreel
