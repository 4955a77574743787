// The JSON of a head, which is refused where src/meshreel/format/checks.py refuses it.
#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include "../../src/format_error.h"
#include "head.h"

namespace meshreel {
namespace {

size_t skip_digits(const std::string& text, size_t at) {
    while (at < text.size() && text[at] >= '0' && text[at] <= '9') ++at;
    return at;
}

bool is_at(const std::string& text, size_t at, char c) { return at < text.size() && text[at] == c; }

bool is_number(const std::string& text) {
    const size_t begin = is_at(text, 0, '-') ? 1 : 0;
    size_t at = skip_digits(text, begin);
    if (at == begin || (text[begin] == '0' && at > begin + 1)) return false;
    if (is_at(text, at, '.')) {
        const size_t point = at + 1;
        at = skip_digits(text, point);
        if (at == point) return false;
    }
    if (is_at(text, at, 'e') || is_at(text, at, 'E')) {
        const size_t exponent = at + (is_at(text, at + 1, '-') || is_at(text, at + 1, '+') ? 2 : 1);
        at = skip_digits(text, exponent);
        if (at == exponent) return false;
    }
    return at == text.size() && std::isfinite(double_of(text));
}

void append(std::string& text, uint32_t point) {
    if (point < 0x80) {
        text += static_cast<char>(point);
        return;
    }
    const int more = point < 0x800 ? 1 : point < 0x10000 ? 2 : 3;
    text += static_cast<char>((0xf00 >> more & 0xff) | point >> (6 * more));
    for (int k = more - 1; k >= 0; --k) text += static_cast<char>(0x80 | (point >> (6 * k) & 0x3f));
}

// A text in UTF-8, value by value. Throws FormatError where it is no JSON, or has half a surrogate.
class Json {
public:
    explicit Json(const std::string& text) : text_(text) {}

    void need(bool holds) const { require(holds, "Header.metadata: not JSON"); }

    // Takes a character if it is next, behind blanks; returns whether it was.
    bool has(char c) {
        skip_blanks();
        if (!is_at(text_, at_, c)) return false;
        ++at_;
        return true;
    }

    void finish() {
        skip_blanks();
        need(at_ == text_.size());
    }

    // Each of what stands between commas, behind an opening bracket.
    template <class Each>
    void list(char end, Each each) {
        if (has(end)) return;
        do each();
        while (has(','));
        need(has(end));
    }

    std::string name() {
        need(has('"'));
        const std::string name = string();
        need(has(':'));
        return name;
    }

    // The text of a value, as it is written.
    std::string value() {
        skip_blanks();
        const size_t begin = at_;
        skip(1);
        return text_.substr(begin, at_ - begin);
    }

    // A string whose opening quote was taken, without escapes.
    std::string string() {
        std::string found;
        for (uint8_t c = take(); c != '"'; c = take()) append(found, c == '\\' ? escaped() : point(c));
        return found;
    }

private:
    void skip_blanks() { at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size()); }

    void skip(int depth) {
        const bool is_object = has('{'), is_list = !is_object && has('[');
        need(depth < kMostNested || !(is_object || is_list));
        if (is_object) list('}', [&] { name(), skip(depth + 1); });
        else if (is_list) list(']', [&] { skip(depth + 1); });
        else if (has('"')) string();
        else skip_word();
    }

    void skip_word() {
        const size_t begin = at_;
        at_ = std::min(text_.find_first_of(" \t\r\n,]}", at_), text_.size());
        const std::string word = text_.substr(begin, at_ - begin);
        need(word == "true" || word == "false" || word == "null" || is_number(word));
    }

    uint8_t take() {
        need(at_ < text_.size());
        return static_cast<uint8_t>(text_[at_++]);
    }

    uint32_t point(uint8_t first) {
        need(first >= 0x20 && (first < 0x80 || (first >= 0xc2 && first <= 0xf4)));
        const int more = first < 0x80 ? 0 : first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3;
        uint32_t found = first & (0x7f >> (more + (more > 0)));
        for (int k = 0; k < more; ++k) {
            const uint8_t next = take();
            need(next >> 6 == 2);
            found = found << 6 | (next & 0x3f);
        }
        const uint32_t least[] = {0, 0x80, 0x800, 0x10000};
        need(found >= least[more] && found <= 0x10ffff && found >> 11 != 0x1b);
        return found;
    }

    uint32_t escaped() {
        const char c = static_cast<char>(take());
        if (c == 'u') return unicode();
        const std::string from = "\"\\/bfnrt", to = "\"\\/\b\f\n\r\t";
        const size_t which = from.find(c);
        need(which < from.size());
        return static_cast<uint8_t>(to[which]);
    }

    uint32_t unicode() {
        const uint32_t first = unit();
        if (first >> 11 != 0x1b) return first;
        need(first < 0xdc00 && take() == '\\' && take() == 'u');
        const uint32_t second = unit();
        need(second >> 10 == 0x37);
        return 0x10000 + ((first & 0x3ff) << 10) + (second & 0x3ff);
    }

    uint32_t unit() {
        const std::string digits = "0123456789abcdef";
        uint32_t found = 0;
        for (int k = 0; k < 4; ++k) {
            const uint8_t c = take();
            const size_t digit = digits.find(static_cast<char>(c >= 'A' && c <= 'F' ? c | 0x20 : c));
            need(digit < digits.size());
            found = found << 4 | static_cast<uint32_t>(digit);
        }
        return found;
    }

    const std::string& text_;
    size_t at_ = 0;
};

}  // namespace

double double_of(const std::string& number) {
    std::istringstream in(number);
    in.imbue(std::locale::classic());  // whatever a program has set
    double value = 0;
    in >> value;
    return in.fail() && std::fabs(value) > 1 ? HUGE_VAL : value;
}

std::map<std::string, std::string> members_of(const std::string& json) {
    std::map<std::string, std::string> members;
    Json text(json);
    require(text.has('{'), "Header.metadata: not a JSON object");
    text.list('}', [&] {
        const std::string name = text.name();
        members[name] = text.value();
    });
    text.finish();
    return members;
}

std::string text_member(const std::string& json, const std::string& name) {
    const std::string value = members_of(json)[name];
    Json text(value);
    return text.has('"') ? text.string() : "";
}

std::vector<std::string> number_list(const std::string& json) {
    std::vector<std::string> numbers;
    Json text(json);
    require(text.has('['), "Header.metadata: edit has no list where one should be");
    text.list(']', [&] {
        numbers.push_back(text.value());
        require(is_number(numbers.back()), "Header.metadata: edit has what is no number where one should be");
    });
    return numbers;
}

}  // namespace meshreel
