// Lines of text, and the numbers in them, each the double nearest to it, as Python's float() reads it, in any locale.
// Encoder only.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "meshreel/status.h"

#ifdef __cplusplus
extern "C" {
#endif

// Where the lines of a text begin, without leading blanks, and end, without comments, which `comment` begins. Lines are
// separated by \n, \r\n or \r. There is room for one more than the text has \n and \r. The number of lines.
size_t mr_split_lines(const char* text, size_t size, char comment, int64_t* starts, int64_t* ends);

// Lines text[starts[k] .. ends[k]) of words between blanks. What follows `stop` in a word is skipped, and so is a word
// that begins with it; 0 stops nothing. With a `field` above 0, what follows so many stops is read of each word, and is
// NaN where it is no number.
struct mr_lines {
    const char* text;
    const int64_t* starts;
    const int64_t* ends;
    size_t count;
    char stop;
    size_t field;
};

// The double nearest to a decimal number of any length, ended by 0, in the grammar of C without signs.
typedef double (*mr_nearest)(const char* word);

// The numbers of all lines, each the double nearest to it in any locale, one line after the other, and how many each
// line has. `nearest` is asked where doubles alone do not round exactly: more than 2^53, or beyond the 22nd power of
// ten. There is room for a number in every second byte of each line, and one more. MR_BAD_INPUT where a word is no
// number: *bad is where it begins.
int mr_read_numbers(const struct mr_lines* lines, mr_nearest nearest, double* values, int32_t* counts, int64_t* bad);

// Rows of fields. Before the items of a list stands their number, a little-endian integer unless `big_endian`.
struct mr_rows {
    const uint8_t* data;
    size_t size;
    size_t count;
    const int64_t* fields;  // bytes of a list's length, 0 where the field is one item; bytes of an item; of each field
    size_t field_count;
    int big_endian;
};

// Copies the items of the field `wanted` of all rows, for which there is room for all data, and sets their number in
// each row and the bytes of all rows. MR_BAD_INPUT where the data ends before the row *bad does.
int mr_read_lists(const struct mr_rows* rows, size_t wanted, uint8_t* items, int64_t* lengths, size_t* size,
                  size_t* bad);

#ifdef __cplusplus
}
#endif
