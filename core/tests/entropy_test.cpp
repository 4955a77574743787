#include "meshreel/entropy.h"

#include "check.h"
#include "shapes.h"

namespace {

const std::vector<int32_t> kNumbers{0, 1, -1, 7, -8, 255, 65536, INT32_MAX, INT32_MIN, 0, 0, 3};

int decode(const Bytes& stream, size_t count, std::vector<int32_t>& values) {
    values.assign(count, -99);
    return mr_decode_integers(stream.data(), stream.size(), count, values.data());
}

std::vector<int32_t> noisy(size_t count) {
    Noise noise(7);
    std::vector<int32_t> values(count);
    for (int32_t& value : values) value = noise.within(2) * noise.within(30);
    return values;
}

}  // namespace

TEST(integers_decode_to_what_was_encoded) {
    std::vector<int32_t> values;
    CHECK(decode(integers(kNumbers), kNumbers.size(), values) == MR_OK);
    CHECK(values == kNumbers);
    CHECK(integers({}).empty() && decode({}, 0, values) == MR_OK);
}

TEST(a_stream_of_integers_has_one_length) {
    const Bytes stream = integers(kNumbers);
    std::vector<int32_t> values;
    for (size_t size = 0; size < stream.size(); ++size)
        CHECK(decode(Bytes(stream.begin(), stream.begin() + size), kNumbers.size(), values) == MR_BAD_STREAM);
    Bytes longer = stream;
    longer.push_back(0);
    CHECK(decode(longer, kNumbers.size(), values) == MR_BAD_STREAM);
    CHECK(decode(stream, 0, values) == MR_BAD_STREAM);
}

TEST(a_changed_byte_changes_the_integers_or_is_refused) {
    const Bytes stream = integers(kNumbers);
    for (size_t place = 0; place < stream.size(); ++place) {
        Bytes changed = stream;
        changed[place] ^= 0x10;
        std::vector<int32_t> values;
        if (decode(changed, kNumbers.size(), values) == MR_OK) CHECK(values != kNumbers && integers(values) == changed);
    }
}

TEST(a_few_bytes_cannot_be_many_integers) {
    std::vector<int32_t> values;
    CHECK(decode({0, 0}, 200'000, values) == MR_BAD_STREAM);
    CHECK(values[0] == -99);
}

TEST(an_output_with_too_little_room_is_told_the_size) {
    Bytes out(3);
    size_t size = 0;
    CHECK(mr_encode_integers(kNumbers.data(), kNumbers.size(), out.data(), out.size(), &size) == MR_OUT_TOO_SMALL);
    CHECK(size == integers(kNumbers).size());
}

TEST(weights_decode_to_what_was_encoded_and_columns_without_those_behind) {
    const Chain chain(300);
    std::vector<int32_t> wanted = noisy(900), found(900);
    Bytes out(4000);
    size_t sizes[3], column = 9;
    const mr_weights given = chain.symbols(wanted, 3), room = chain.symbols(found, 3), two = chain.symbols(found, 2);
    CHECK(mr_encode_weights(&given, out.data(), out.size(), sizes) == MR_OK);
    CHECK(mr_decode_weights(&room, out.data(), sizes, &column) == MR_OK && found == wanted);
    found.assign(900, 0);
    CHECK(mr_decode_weights(&two, out.data(), sizes, &column) == MR_OK);
    CHECK(std::vector<int32_t>(found.begin(), found.begin() + 600) ==
          std::vector<int32_t>(wanted.begin(), wanted.begin() + 600));
    --sizes[1];
    CHECK(mr_decode_weights(&room, out.data(), sizes, &column) == MR_BAD_STREAM && column == 1);
}

TEST(contexts_of_weights_stay_in_their_tables) {
    const Chain chain(200);
    std::vector<int32_t> values = noisy(400);
    values[5] = INT32_MIN, values[6] = INT32_MAX;
    Bytes classes(400), signs(400);
    const mr_weights weights = chain.symbols(values, 2);
    CHECK(mr_weight_contexts(&weights, classes.data(), signs.data()) == MR_OK);
    for (size_t k = 0; k < 400; ++k) CHECK(classes[k] < 15 && signs[k] < 48);
}

TEST(neighbours_that_are_not_before_their_vertex_are_refused) {
    std::vector<int32_t> values(4);
    for (int bad = 0; bad < 4; ++bad) {
        Chain chain(4);
        if (bad == 0) chain.near.back() = 3;
        if (bad == 1) chain.near.back() = -1;
        if (bad == 2) chain.starts[2] = 9;
        if (bad == 3) chain.starts[0] = 1;
        const mr_weights weights = chain.symbols(values, 1);
        size_t size = 1;
        CHECK(mr_decode_weights(&weights, Bytes{0}.data(), &size, &size) == MR_NOT_CAUSAL);
        CHECK(mr_encode_weights(&weights, nullptr, 0, &size) == MR_NOT_CAUSAL);
        CHECK(mr_encode_field(&weights, nullptr, 0, &size, nullptr) == MR_NOT_CAUSAL);
        CHECK(mr_weight_contexts(&weights, nullptr, nullptr) == MR_NOT_CAUSAL);
    }
}
