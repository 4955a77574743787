// Fields: field_coder, field_record, field_rows, and the basis of orthonormal.cpp.
#include "check.h"
#include "shapes.h"

namespace {

const Chain kChain(5);

int decode(const Bytes& record, size_t width, size_t head, std::vector<double>& rows) {
    const mr_bytes bytes{record.data(), record.size()};
    const mr_graph graph = kChain.view();
    rows.assign(graph.count * width, -99.0);
    return mr_decode_field(&bytes, &graph, width, head, rows.data());
}

int status_of(const Bytes& record, size_t width = 2) {
    std::vector<double> rows;
    return decode(record, width, 0, rows);
}

const Bytes kStream = symbols(kChain, {8, 0, 4, 0, 0}, 1);

}  // namespace

TEST(rows_of_a_field_are_predicted_weights_times_the_basis_behind_other_integers) {
    // Steps of 1 (level 0); three integers that are no part of it; the basis is the axis y.
    const Bytes record = coded_field(1, 0, integers({2, 2, -1, 0, 5}), kStream);
    std::vector<double> rows;
    CHECK(decode(record, 2, 3, rows) == MR_OK);
    const double weights[] = {8, 8, 12, 10, 11};  // each symbol more than the mean of two before
    for (size_t v = 0; v < 5; ++v) CHECK(rows[2 * v] == 0.0 && rows[2 * v + 1] == weights[v]);
}

TEST(steps_halve_every_eight_levels) {
    std::vector<double> rows;
    CHECK(decode(coded_field(1, 16, integers({1, 0}), kStream), 2, 0, rows) == MR_OK);
    CHECK(rows[0] == 2.0 && rows[1] == 0.0);
}

TEST(a_record_has_one_length) {
    const Bytes record = coded_field(1, 0, integers({1, 0}), kStream);
    for (size_t size = 0; size < record.size(); ++size)
        CHECK(status_of(Bytes(record.begin(), record.begin() + size)) == MR_BAD_RECORD);
    Bytes longer = record;
    longer.push_back(0);
    CHECK(status_of(longer) == MR_BAD_RECORD);
    CHECK(status_of({0x81, 0x00, 0, 0, 0}) == MR_BAD_RECORD);  // a number longer than it needs to be
    Bytes beyond(9, 0xFF);
    for (uint8_t last : {0x02, 0xFF}) {
        Bytes wide = beyond;
        wide.insert(wide.end(), {last, 0, 0, 0});
        CHECK(status_of(wide) == MR_BAD_RECORD);  // beyond 64 bits
    }
}

TEST(fields_that_contradict_themselves_are_refused_in_words) {
    const Bytes basis = integers({1, 0});
    CHECK(status_of(coded_field(3, 0, basis, kStream)) == MR_BAD_COLUMNS);
    CHECK(status_of(coded_field(1, 200, basis, kStream)) == MR_BAD_COLUMNS);
    CHECK(status_of(coded_field(1, 0, integers({1, 0, 0}), kStream)) == MR_BAD_BASIS);
    CHECK(status_of(coded_field(1, 0, {}, kStream)) == MR_BAD_BASIS);
    CHECK(status_of(coded_field(1, 0, integers({0, 0}), kStream)) == MR_NO_DIRECTION);
    CHECK(status_of(coded_field(1, 0, basis, {})) == MR_BAD_SYMBOLS);
    CHECK(status_of(coded_field(0, 0, {}, kStream)) == MR_BAD_SYMBOLS);
    CHECK(status_of(coded_field(1, 0, basis, {1, 2, 3})) == MR_BAD_SYMBOLS);
    CHECK(status_of(coded_field(0, 0, {}, {})) == MR_OK);
}

TEST(a_field_of_many_columns_decodes_to_its_symbols) {
    const Chain chain(150);
    Noise noise(3);
    std::vector<int32_t> wanted(450), basis;
    for (int32_t& symbol : wanted) symbol = noise.within(3) * noise.within(40);
    wanted[7] = INT32_MAX, wanted[8] = INT32_MIN;
    for (size_t k = 0; k < 3; ++k)
        for (size_t i = k; i < 3; ++i) basis.push_back(i == k ? -1 : 0);
    Bytes stream = symbols(chain, wanted, 3), record{3, 0, static_cast<uint8_t>(integers(basis).size())};
    for (uint8_t byte : integers(basis)) record.push_back(byte);
    record.push_back(static_cast<uint8_t>(stream.size() | 0x80)),
        record.push_back(static_cast<uint8_t>(stream.size() >> 7));
    record.insert(record.end(), stream.begin(), stream.end());
    const mr_bytes bytes{record.data(), record.size()};
    const mr_graph graph = chain.view();
    std::vector<double> rows(450);
    CHECK(mr_decode_field(&bytes, &graph, 3, 0, rows.data()) == MR_OK);
    for (size_t v = 2; v < 150; ++v)  // the basis is an axis each, up to signs
        for (size_t c = 0; c < 3; ++c) {
            const double predicted = (rows[3 * v - 6 + c] + rows[3 * v - 3 + c]) / 2;
            const double symbol = wanted[150 * c + v];
            CHECK(std::fabs(std::fabs(rows[3 * v + c] - predicted) - std::fabs(symbol)) < 1e-5);
        }
}

TEST(a_basis_is_orthonormal) {
    const size_t width = 9, count = 6;
    Noise noise(5);
    std::vector<int32_t> numbers(width * count - count * (count - 1) / 2);
    for (int32_t& number : numbers) number = noise.within(100);
    std::vector<double> vectors(count * width);
    CHECK(mr_orthonormal_inverse(numbers.data(), count, width, vectors.data()) == MR_OK);
    for (size_t a = 0; a < count; ++a)
        for (size_t b = 0; b < count; ++b) {
            double sum = 0;
            for (size_t k = 0; k < width; ++k) sum += vectors[a * width + k] * vectors[b * width + k];
            CHECK(std::fabs(sum - (a == b)) < 1e-14);
        }
    CHECK(mr_orthonormal_inverse(numbers.data(), 3, 2, vectors.data()) == MR_BAD_INPUT);
}
