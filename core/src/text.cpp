#include "meshreel/reading.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <system_error>

#include "guarded.h"

namespace meshreel {
namespace {

constexpr uint64_t EXACT = uint64_t{1} << 53;  // doubles have all integers up to it
constexpr int64_t LONGEST = 19;                // digits that 64 bits hold
constexpr double POWERS[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                             1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};  // all of them exact
constexpr int64_t LAST_POWER = 22;
constexpr int64_t FAR = 100000;  // larger exponents need not be told apart: such numbers are left to `nearest`

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// The number that begins a line's rest.
class Number {
public:
    Number(const char* begin, const char* end, char stop) : at_(begin), end_(end), stop_(stop) {}

    const char* behind() const { return at_; }

    // True if a number begins here; it becomes *value.
    bool read(mr_nearest nearest, double* value) {
        const bool negative = at_ != end_ && *at_ == '-';
        if (negative || (at_ != end_ && *at_ == '+')) ++at_;
        const char* begin = at_;
        if (decimal() && word_ends()) *value = rounded(begin, nearest);
        else if (at_ = begin; is("inf") || is("infinity")) *value = std::numeric_limits<double>::infinity();
        else if (is("nan")) *value = std::numeric_limits<double>::quiet_NaN();
        else return false;
        if (negative) *value = -*value;
        return true;
    }

private:
    bool word_ends() const { return at_ == end_ || is_blank(*at_) || (*at_ == stop_ && stop_ != 0); }

    bool is(const char* name) {
        const char* begin = at_;
        for (; *name != 0 && at_ != end_ && (*at_ | 0x20) == *name; ++at_) ++name;
        if (*name == 0 && word_ends()) return true;
        at_ = begin;
        return false;
    }

    // Reads digits, point and exponent as digits_ * 10^power_.
    bool decimal() {
        int64_t count = digits();
        if (at_ != end_ && *at_ == '.') {
            ++at_;
            const int64_t behind_point = digits();
            power_ -= behind_point;
            count += behind_point;
        }
        is_exact_ = count <= LONGEST && digits_ <= EXACT;
        return count > 0 && exponent();
    }

    int64_t digits() {
        const char* begin = at_;
        for (; at_ != end_ && is_digit(*at_); ++at_)
            digits_ = 10 * digits_ + static_cast<uint64_t>(*at_ - '0');  // wraps around behind the LONGEST
        return at_ - begin;
    }

    bool exponent() {
        if (at_ == end_ || (*at_ | 0x20) != 'e') return true;
        const bool negative = ++at_ != end_ && *at_ == '-';
        if (negative || (at_ != end_ && *at_ == '+')) ++at_;
        const char* begin = at_;
        int64_t value = 0;
        for (; at_ != end_ && is_digit(*at_); ++at_) value = value < FAR ? 10 * value + (*at_ - '0') : FAR;
        power_ += negative ? -value : value;
        return at_ != begin;
    }

    // The nearest double: one rounding of two exact numbers where both are.
    double rounded(const char* begin, mr_nearest nearest) const {
        const double whole = static_cast<double>(digits_);
        if (is_exact_ && power_ <= 0 && power_ >= -LAST_POWER) return whole / POWERS[-power_];
        if (is_exact_ && power_ > 0 && power_ <= LAST_POWER) return whole * POWERS[power_];
#if defined(__cpp_lib_to_chars)
        double value;
        if (std::from_chars(begin, at_, value).ec == std::errc()) return value;  // else it is beyond all doubles
#endif
        return nearest(std::string(begin, at_).c_str());
    }

    const char *at_, *end_;
    char stop_;
    uint64_t digits_ = 0;
    int64_t power_ = 0;
    bool is_exact_ = false;
};

// Text behind `count` stops in a word; the end of the word if it has fewer.
const char* behind_stops(const char* at, const char* end, char stop, size_t count) {
    for (; at != end && !is_blank(*at) && count > 0; ++at) count -= *at == stop;
    return at;
}

}  // namespace
}  // namespace meshreel

using namespace meshreel;

size_t mr_split_lines(const char* text, size_t size, char comment, int64_t* starts, int64_t* ends) {
    const auto is_end = [](char c) { return c == '\n' || c == '\r'; };
    const char *at = text, *end = text + size;
    for (size_t line = 0;; ++line, ++at) {
        at = std::find_if(at, end, [&](char c) { return !is_blank(c) || is_end(c); });
        starts[line] = at - text;
        at = std::find_if(at, end, [&](char c) { return is_end(c) || c == comment; });
        ends[line] = at - text;
        at = std::find_if(at, end, is_end);
        if (at == end) return line + 1;
        if (*at == '\r' && at + 1 != end && at[1] == '\n') ++at;
    }
}

int mr_read_numbers(const mr_lines* lines, mr_nearest nearest, double* values, int32_t* counts, int64_t* bad) {
    const auto body = [&] {
        for (size_t k = 0; k < lines->count; ++k) {
            const char *at = lines->text + lines->starts[k], *end = lines->text + lines->ends[k];
            const double* before = values;
            while (true) {
                at = std::find_if_not(at, end, is_blank);
                if (at == end) break;
                if (lines->field > 0) {
                    at = behind_stops(at, end, lines->stop, lines->field);
                    if (!Number(at, end, lines->stop).read(nearest, values)) *values = std::nan("");
                    ++values;
                } else if (*at != lines->stop || lines->stop == 0) {
                    Number number(at, end, lines->stop);
                    if (!number.read(nearest, values)) {
                        *bad = at - lines->text;
                        return int{MR_BAD_INPUT};
                    }
                    at = number.behind();
                    ++values;
                }
                at = std::find_if(at, end, is_blank);  // behind a stop
            }
            counts[k] = static_cast<int32_t>(values - before);
        }
        return int{MR_OK};
    };
    return guarded(MR_NO_MEMORY, body);
}
