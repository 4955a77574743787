#include "meshreel/draco.h"

#include <set>

#include "check.h"
#include "shapes.h"

namespace {

int check(const Bytes& data) {
    const mr_bytes bytes{data.data(), data.size()};
    return mr_check_draco(&bytes, 1);
}

}  // namespace

TEST(no_bytes_are_the_empty_mesh) {
    CHECK(check({}) == MR_OK);
    CHECK(mr_check_draco(nullptr, 0) == MR_OK);
}

TEST(a_head_that_is_not_of_our_kind_is_refused_before_its_claims_are_read) {
    const Bytes head{'D', 'R', 'A', 'C', 'O', 2, 2, 1, 1, 0, 0};
    CHECK(check(head) != MR_OK);
    std::set<int> statuses;
    for (size_t place : {0u, 7u, 8u, 10u}) {
        Bytes other = head;
        other[place] ^= 0x80;
        statuses.insert(check(other));
    }
    CHECK(statuses.size() == 4 && statuses.count(MR_OK) == 0);
}

TEST(claims_beyond_what_the_bytes_may_are_refused) {
    Bytes data{'D', 'R', 'A', 'C', 'O', 2, 2, 1, 1, 0, 0, 2, 0x80, 0x84, 0xAF, 0x5F, 0x80, 0x84, 0xAF, 0x5F, 0, 0, 0};
    CHECK(check(data) == MR_DRACO_CLAIMS);
}
