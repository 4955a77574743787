#include <cstring>

#include "meshreel/reading.h"

int mr_read_lists(const mr_rows* rows, size_t wanted, uint8_t* items, int64_t* lengths, size_t* size, size_t* bad) {
    const uint8_t *at = rows->data, *end = rows->data + rows->size;
    for (*bad = 0; *bad < rows->count; ++*bad)
        for (size_t f = 0; f < rows->field_count; ++f) {
            const size_t digits = static_cast<size_t>(rows->fields[2 * f]);
            const size_t width = static_cast<size_t>(rows->fields[2 * f + 1]);
            if (static_cast<size_t>(end - at) < digits) return MR_BAD_INPUT;
            uint64_t length = digits == 0;
            for (size_t k = 0; k < digits; ++k) length = length << 8 | at[rows->big_endian != 0 ? k : digits - 1 - k];
            at += digits;
            if (length > static_cast<size_t>(end - at) / width) return MR_BAD_INPUT;
            const size_t bytes = static_cast<size_t>(length) * width;
            if (f == wanted) {
                std::memcpy(items, at, bytes);
                items += bytes;
                lengths[*bad] = static_cast<int64_t>(length);
            }
            at += bytes;
        }
    *size = static_cast<size_t>(at - rows->data);
    return MR_OK;
}
