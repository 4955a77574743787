// The little of JSON that a head needs.
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

}  // namespace

std::string text_member(const std::string& json, const std::string& name) {
    int depth = 0;
    for (size_t at = 0; at < json.size();) {
        if (json[at] != '"') {
            depth += json[at] == '{' || json[at] == '[' ? 1 : json[at] == '}' || json[at] == ']' ? -1 : 0;
            ++at;
            continue;
        }
        const std::string word = string_at(json, at);
        size_t next = skip_blanks(json, at);
        if (depth != 1 || word != name || next >= json.size() || json[next] != ':') continue;
        next = skip_blanks(json, next + 1);
        return next < json.size() && json[next] == '"' ? string_at(json, next) : "";
    }
    return "";
}

}  // namespace meshreel
