#include "meshreel/reading.h"

#include <cstdlib>
#include <limits>
#include <string>

#include "check.h"
#include "shapes.h"

namespace {

int asked = 0;

double nearest(const char* word) {
    ++asked;
    return std::strtod(word, nullptr);
}

// The numbers of one line; `bad` is -1 where all of its words are numbers.
std::vector<double> numbers(const std::string& line, char stop, int64_t& bad, size_t field = 0) {
    const int64_t start = 0, end = static_cast<int64_t>(line.size());
    const mr_lines lines{line.data(), &start, &end, 1, stop, field};
    std::vector<double> values(line.size() / 2 + 1);
    int32_t count = 0;
    bad = -1;
    const int status = mr_read_numbers(&lines, nearest, values.data(), &count, &bad);
    CHECK(status == (bad < 0 ? MR_OK : MR_BAD_INPUT));
    values.resize(static_cast<size_t>(count));
    return values;
}

}  // namespace

TEST(numbers_are_the_nearest_doubles) {
    int64_t bad = 0;
    const std::string line = " 1 -2.5\t.5 +1. 1e2 1E-2 123456.789 9007199254740993 9007199254740993e-3 0.1e-400 1e999 ";
    const std::vector<double> expected{1,
                                       -2.5,
                                       0.5,
                                       1,
                                       100,
                                       0.01,
                                       123456.789,
                                       9007199254740992,
                                       9007199254740.993,
                                       0,
                                       std::numeric_limits<double>::infinity()};
    CHECK(numbers(line, 0, bad) == expected && bad < 0);
    asked = 0;
    CHECK(numbers("9007199254740992e-22 1e22 0.000000000000000001 -0", 0, bad).size() == 4 && asked == 0);
    CHECK(std::signbit(numbers("-0.0", 0, bad)[0]) && std::isnan(numbers("-NaN", 0, bad)[0]));
    CHECK(numbers("-inf Infinity", 0, bad)[0] < 0 && bad < 0);
    CHECK(numbers(std::string(1000, '1') + "e-999", 0, bad)[0] == 1.1111111111111112);
}

TEST(what_follows_a_stop_is_no_number) {
    int64_t bad = 0;
    CHECK(numbers("1/2/3 /4 5//x inf/", '/', bad) ==
          std::vector<double>({1, 5, std::numeric_limits<double>::infinity()}));
    CHECK(numbers("1/2", 0, bad).empty() && bad == 0);
    const std::vector<double> second = numbers("1/2/3 4//5 6 7/-8", '/', bad, 1);
    CHECK(second.size() == 4 && second[0] == 2 && std::isnan(second[1]) && std::isnan(second[2]) && second[3] == -8);
}

TEST(words_that_are_no_numbers_are_pointed_at) {
    const std::string wrong[] = {"x",    ".",   "-",  "+-1",  "1e",   "1e+", "1.0.5", "1,5",
                                 "0x10", "1_0", "in", "infi", "nanx", "e5",  "1\x7f", std::string("1\0", 2),
                                 "\xff"};
    for (const std::string& word : wrong) {
        int64_t bad = -1;
        numbers("1 2 " + word + " 3", 0, bad);
        CHECK(bad == 4);
    }
}

TEST(lines_end_at_any_newline_and_before_comments) {
    const std::string text = "  a # b\n\r\n#c\r\td\n";
    int64_t starts[6], ends[6];
    CHECK(mr_split_lines(text.data(), text.size(), '#', starts, ends) == 5);
    const std::string expected[] = {"a ", "", "", "d", ""};
    for (size_t k = 0; k < 5; ++k)
        CHECK(text.substr(static_cast<size_t>(starts[k]), static_cast<size_t>(ends[k] - starts[k])) == expected[k]);
    CHECK(mr_split_lines(nullptr, 0, '#', starts, ends) == 1 && starts[0] == 0 && ends[0] == 0);
}
