#include "renderer/keys/toml_depth.h"

#include <fmt/format.h>

#include <algorithm>

namespace narpa {

namespace {

bool is_in_key(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == ' ' || c == '\t' || static_cast<unsigned char>(c) >= 0x80;
}

/// The end of the quoted text that begins at `from`. A single-line text ends with its line at the latest.
std::size_t end_of_quotes(std::string_view text, std::size_t from) {
    const char quote = text[from];
    const std::string three(3, quote);
    const bool has_lines = text.substr(from, 3) == three;
    for (std::size_t at = from + (has_lines ? 3 : 1); at < text.size(); ++at) {
        if (text[at] == '\\' && quote == '"') {
            ++at;
        } else if (has_lines && text.substr(at, 3) == three) {
            at += 3;
            for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) ++at;  // """a"""""
            return at;
        } else if (!has_lines && (text[at] == quote || text[at] == '\n')) {
            return text[at] == '\n' ? at : at + 1;
        }
    }
    return text.size();
}

}  // namespace

Status check_toml_depth(std::string_view text, const std::string& file) {
    int dots = 0, level = 0;
    for (std::size_t at = 0; at < text.size();) {
        const char c = text[at];
        if (c == '"' || c == '\'') {
            at = end_of_quotes(text, at);
            continue;
        }
        if (c == '#') {
            at = std::min(text.find('\n', at), text.size());
            continue;
        }
        if (c == '.') {
            ++dots;
        } else if (!is_in_key(c)) {
            dots = 0;
            if (c == '[' || c == '{') ++level;
            if ((c == ']' || c == '}') && level > 0) --level;
        }
        if (dots >= kDeepestToml || level > kDeepestToml) {
            const std::string_view before = text.substr(0, at);
            const std::size_t line_start = before.rfind('\n') + 1;  // npos + 1 is 0
            return Error{
                .what = dots >= kDeepestToml
                            ? fmt::format("a key of more than {} parts, expected fewer dots", kDeepestToml)
                            : fmt::format("more than {} arrays and tables inside one another, expected fewer",
                                          kDeepestToml),
                .file = file,
                .line = 1 + static_cast<int>(std::count(before.begin(), before.end(), '\n')),
                .column = 1 + static_cast<int>(at - line_start)};
        }
        ++at;
    }
    return Ok{};
}

}  // namespace narpa
