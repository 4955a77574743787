// The encoder's quantisers: prediction.cpp and surface_quantizer.cpp.
#include "check.h"
#include "shapes.h"

namespace {

const Chain kChain(60);

std::vector<double> wave() {
    std::vector<double> values(120);
    for (size_t k = 0; k < values.size(); ++k) values[k] = std::sin(0.2 * double(k)) + 0.01 * double(k % 7);
    return values;
}

double largest_error(const std::vector<double>& decoded) {
    double most = 0;
    for (size_t k = 0; k < decoded.size(); ++k) most = std::fmax(most, std::fabs(decoded[k] - wave()[k]));
    return most;
}

int64_t total(const std::vector<int32_t>& symbols) {
    int64_t sum = 0;
    for (int32_t symbol : symbols) sum += symbol < 0 ? -int64_t{symbol} : symbol;
    return sum;
}

}  // namespace

TEST(a_free_bit_leaves_half_a_step_of_error_and_a_dear_one_saves_symbols) {
    const mr_graph graph = kChain.view();
    std::vector<int32_t> fine(120), coarse(120);
    std::vector<double> decoded(120);
    CHECK(mr_predict_forward(&graph, wave().data(), 2, 0.1, 0.0, fine.data(), decoded.data()) == MR_OK);
    CHECK(largest_error(decoded) <= 0.05 + 1e-12);
    CHECK(mr_predict_forward(&graph, wave().data(), 2, 0.1, 0.3, coarse.data(), decoded.data()) == MR_OK);
    CHECK(total(coarse) < total(fine) && largest_error(decoded) < 0.15);
}

TEST(errors_along_a_surface_count_less) {
    const mr_graph graph = kChain.view();
    const std::vector<double> vectors{1, 0, 0, 0, 0, 1};  // a column along the surface, one across it
    std::vector<double> normals(180), decoded(120);
    for (size_t v = 0; v < 60; ++v) normals[3 * v + 2] = 1;
    std::vector<int32_t> found(120);
    double errors[2][2];
    for (double tangential : {1.0, 0.05}) {
        const mr_surface surface{2, 3, vectors.data(), normals.data(), tangential};
        CHECK(mr_predict_surface(&graph, &surface, wave().data(), 0.02, 0.3, found.data(), decoded.data()) == MR_OK);
        for (size_t c = 0; c < 2; ++c) {
            double& sum = errors[tangential < 1.0][c] = 0;
            for (size_t v = 0; v < 60; ++v) sum += std::pow(decoded[60 * c + v] - wave()[60 * c + v], 2);
        }
    }
    CHECK(errors[1][0] > errors[0][0]);
    CHECK(errors[1][1] < errors[1][0]);
}

TEST(values_without_a_symbol_and_graphs_that_are_not_causal_are_refused) {
    Chain chain(3);
    const double values[] = {0, 1e12, 0};
    int32_t found[3];
    double decoded[3];
    const mr_graph graph = chain.view();
    CHECK(mr_predict_forward(&graph, values, 1, 1.0, 0.0, found, decoded) == MR_OVERFLOW);
    CHECK(mr_predict_forward(&graph, values, 1, 1.0, 0.1, found, decoded) == MR_OVERFLOW);
    chain.near[0] = 2;
    CHECK(mr_predict_forward(&graph, values, 1, 1.0, 0.0, found, decoded) == MR_NOT_CAUSAL);
    const mr_surface surface{0, 3, nullptr, nullptr, 1.0};
    CHECK(mr_predict_surface(&graph, &surface, values, 1.0, 0.0, found, decoded) == MR_NOT_CAUSAL);
}
