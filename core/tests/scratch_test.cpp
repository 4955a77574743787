#include "../src/scratch.h"

#include <cstring>

#include "check.h"

using namespace meshreel;

TEST(blocks_in_use_share_no_memory_and_begin_at_a_cache_line) {
    for (const size_t size : {size_t{0}, size_t{1}, size_t{40000}, size_t{9000000}}) {  // the last is never kept
        for (int time = 0; time < 3; ++time) {
            Scratch<uint8_t> a = scratch<uint8_t>(size), b = scratch<uint8_t>(size);
            CHECK(reinterpret_cast<uintptr_t>(a.get()) % 64 == 0);
            std::memset(a.get(), 1, size);
            std::memset(b.get(), 2, size);
            CHECK(size == 0 || (a[0] == 1 && a[size - 1] == 1));
        }
    }
}

TEST(many_blocks_of_all_sizes_keep_what_is_written_to_them) {
    std::vector<Array<uint32_t>> held;
    for (uint32_t k = 0; k < 200; ++k) {
        held.emplace_back(100 * k, k);
        if (k % 3 == 0) held[k / 2] = Array<uint32_t>(50 * k, k / 2);  // gives one back
    }
    for (uint32_t k = 0; k < 200; ++k)
        for (const uint32_t value : held[k]) CHECK(value == k);
}

TEST(an_array_that_no_memory_holds_is_refused) {
    bool refused = false;
    try {
        scratch<double>(SIZE_MAX / 2);
    } catch (const std::bad_alloc&) {
        refused = true;
    }
    CHECK(refused);
}
