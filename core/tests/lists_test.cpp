#include "check.h"
#include "meshreel/reading.h"
#include "shapes.h"

TEST(lists_of_any_lengths_are_found_in_both_byte_orders) {
    const uint8_t little[] = {2, 0, 10, 11, 0xaa, 0, 0, 0xbb, 1, 0, 12, 0xcc};
    const uint8_t big[] = {0, 2, 10, 11, 0xaa, 0, 0, 0xbb, 0, 1, 12, 0xcc};
    const int64_t fields[] = {2, 1, 0, 1};  // a list of bytes, and a byte
    for (const uint8_t* data : {little, big}) {
        const mr_rows rows{data, 12, 3, fields, 2, data == big};
        std::vector<uint8_t> items(12);
        std::vector<int64_t> lengths(3);
        size_t size = 0, bad = 0;
        CHECK(mr_read_lists(&rows, 0, items.data(), lengths.data(), &size, &bad) == MR_OK && size == 12);
        CHECK(lengths == std::vector<int64_t>({2, 0, 1}) && items[0] == 10 && items[1] == 11 && items[2] == 12);
        CHECK(mr_read_lists(&rows, 1, items.data(), lengths.data(), &size, &bad) == MR_OK && items[2] == 0xcc);
        for (size_t cut = 0; cut < 12; ++cut) {
            const std::vector<uint8_t> exact(data, data + cut);  // so that a sanitizer sees what is read behind it
            const mr_rows less{exact.data(), cut, 3, fields, 2, data == big};
            CHECK(mr_read_lists(&less, 0, items.data(), lengths.data(), &size, &bad) == MR_BAD_INPUT);
            CHECK(bad == (cut < 5 ? 0u : cut < 8 ? 1u : 2u));
        }
    }
    const uint8_t endless[] = {255, 255, 255, 255, 255, 255, 255, 255, 1};
    const int64_t wide[] = {8, 8};
    const mr_rows rows{endless, 9, 1, wide, 1, 0};
    size_t size = 0, bad = 1;
    CHECK(mr_read_lists(&rows, 0, nullptr, nullptr, &size, &bad) == MR_BAD_INPUT && bad == 0);
}
