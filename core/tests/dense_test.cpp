#include "meshreel/dense.h"

#include "check.h"
#include "shapes.h"

TEST(products_and_inverses_of_matrices_undo_each_other) {
    const double matrices[] = {2, 1, 0, 4, 0, 1, -1, 0};
    double inverses[8], products[8];
    CHECK(mr_inverses(matrices, 2, 2, inverses) == MR_OK);
    mr_products(matrices, inverses, 2, 2, 2, 2, products);
    for (int k = 0; k < 8; ++k) CHECK(products[k] == (k % 4 == 0 || k % 4 == 3));
    const double flat[] = {1, 2, 2, 4};
    CHECK(mr_inverses(flat, 1, 2, inverses) == MR_OK && !std::isfinite(inverses[0]));
}

TEST(eigenvectors_are_turned_into_their_multiples) {
    const double matrix[] = {2, 1, 0, 1, 3, 1, 0, 1, 4};
    double values[3], vectors[9], turned[9];
    CHECK(mr_eigen(matrix, 1, 3, values, vectors) == MR_OK);
    CHECK(values[0] < values[1] && values[1] < values[2]);
    mr_products(matrix, vectors, 1, 3, 3, 3, turned);
    for (int k = 0; k < 9; ++k) CHECK(std::fabs(turned[k] - values[k % 3] * vectors[k]) < 1e-14);
}

TEST(functions_are_those_of_the_standard_library_to_a_few_bits) {
    const double x[] = {1e-300, 0.3, 1, 2, 700}, y[] = {0, 1, 5e-3, 1e3, 2};
    double powers[5], logarithms[5], angles[5];
    mr_exp(y, 3, powers), mr_log2(x, 5, logarithms), mr_angle(y, x, 5, angles);
    for (int k = 0; k < 5; ++k) {
        if (k < 3) CHECK(std::fabs(powers[k] / std::exp(y[k]) - 1) < 1e-15);
        CHECK(std::fabs(logarithms[k] - std::log2(x[k])) <= 1e-15 * std::fabs(std::log2(x[k])));
        CHECK(std::fabs(angles[k] - std::atan2(y[k], x[k])) < 1e-15);
    }
}
