// The little of JSON that a head needs.
#include "format_error.h"
#include "head.h"

namespace meshreel {
namespace {

// The text of a string whose opening quote is at `at`, which is moved behind its closing one; its escapes stay.
std::string string_at(const std::string& json, size_t& at) {
    const size_t begin = ++at;
    while (at < json.size() && json[at] != '"') at += json[at] == '\\' ? 2 : 1;
    const size_t end = at < json.size() ? at : json.size();
    ++at;
    return json.substr(begin, end - begin);
}

size_t skip_blanks(const std::string& json, size_t at) {
    const size_t found = json.find_first_not_of(" \t\r\n", at);
    return found == std::string::npos ? json.size() : found;
}

// The text up to a comma or a bracket that is not of the value itself, to which `at` is moved; without blanks behind.
std::string value_at(const std::string& json, size_t& at) {
    const size_t begin = at;
    for (int depth = 0; at < json.size();) {
        const char c = json[at];
        if (depth == 0 && (c == ',' || c == '}' || c == ']')) break;
        depth += c == '{' || c == '[' ? 1 : c == '}' || c == ']' ? -1 : 0;
        if (c == '"') string_at(json, at);
        else ++at;
    }
    const std::string value = json.substr(begin, at - begin);
    return value.substr(0, value.find_last_not_of(" \t\r\n") + 1);
}

bool is_at(const std::string& json, size_t at, char c) { return at < json.size() && json[at] == c; }

size_t skip_digits(const std::string& text, size_t at) {
    while (at < text.size() && text[at] >= '0' && text[at] <= '9') ++at;
    return at;
}

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
    return at == text.size();
}

bool is_behind(const std::string& json, size_t at) { return skip_blanks(json, at) == json.size(); }

}  // namespace

bool read_members(const std::string& json, std::map<std::string, std::string>& members) {
    size_t at = skip_blanks(json, 0);
    if (!is_at(json, at, '{')) return false;
    at = skip_blanks(json, at + 1);
    if (is_at(json, at, '}')) return is_behind(json, at + 1);
    while (is_at(json, at, '"')) {
        const std::string name = string_at(json, at);
        at = skip_blanks(json, at);
        if (!is_at(json, at, ':')) return false;
        at = skip_blanks(json, at + 1);
        members[name] = value_at(json, at);
        if (is_at(json, at, '}')) return is_behind(json, at + 1);
        if (!is_at(json, at, ',')) return false;
        at = skip_blanks(json, at + 1);
    }
    return false;
}

std::string text_member(const std::string& json, const std::string& name) {
    std::map<std::string, std::string> members;
    read_members(json, members);
    const std::string& value = members[name];
    size_t at = 0;
    return is_at(value, 0, '"') ? string_at(value, at) : "";
}

std::vector<std::string> number_list(const std::string& json) {
    std::vector<std::string> numbers;
    require(is_at(json, 0, '['), "Header.metadata: edit has no list where one should be");
    size_t at = skip_blanks(json, 1);
    if (is_at(json, at, ']') && at + 1 == json.size()) return numbers;
    for (; at < json.size(); at = skip_blanks(json, at + 1)) {
        numbers.push_back(value_at(json, at));
        require(is_number(numbers.back()), "Header.metadata: edit has what is no number where one should be");
        if (is_at(json, at, ']') && at + 1 == json.size()) return numbers;
        if (!is_at(json, at, ',')) break;
    }
    throw FormatError("Header.metadata: edit has a list that does not end");
}

}  // namespace meshreel
