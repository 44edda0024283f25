// tests/rehearsal/markup.h - is a text well-formed: tags closed in order, attributes quoted, no bare & or <.
#pragma once

#include <regex>
#include <string>
#include <vector>

namespace narpa::rehearsal {

/// Empty, or what is wrong and where. XML, and HTML that closes all its tags.
inline std::string markup_error(const std::string& text) {
    static const std::regex tag(R"re(^<(/?)([A-Za-z][\w:-]*)((\s+[\w:-]+="[^"<]*")*)\s*(/?)>)re");
    static const std::regex entity("^&(amp|lt|gt|quot|#[0-9]+);");
    std::vector<std::string> open;
    const auto wrong = [&](std::size_t at, const std::string& what) {
        return what + " at " + std::to_string(at) + ": " + text.substr(at, 60);
    };
    for (std::size_t i = 0; i < text.size();) {
        if (text.compare(i, 9, "<!DOCTYPE") == 0 || text.compare(i, 2, "<?") == 0) {
            i = text.find('>', i) + 1;
        } else if (text[i] == '<') {
            // A tag's data (a picture, a path) may be longer than a regular expression bears: the ends will do.
            const std::size_t end = text.find('>', i);
            if (end == std::string::npos) return wrong(i, "a tag without end");
            std::string whole = text.substr(i, end - i + 1);
            if (whole.size() > 2000) {
                std::string shortened;
                bool quoted = false;
                std::size_t kept = 0;
                for (const char c : whole) {
                    if (c == '"') quoted = !quoted, kept = 0;
                    if (!quoted || c == '<' || ++kept < 20) shortened += c;
                }
                whole = shortened;
            }
            std::smatch m;
            if (!std::regex_search(whole, m, tag)) return wrong(i, "not a tag");
            if (m[1].length() > 0) {
                if (open.empty() || open.back() != m[2].str()) return wrong(i, "closes what is not open");
                open.pop_back();
            } else if (m[5].length() == 0) {
                open.push_back(m[2].str());
            }
            i = end + 1;
        } else {
            if (text[i] == '&') {
                const std::string here = text.substr(i, 10);
                if (!std::regex_search(here, entity)) return wrong(i, "a bare &");
            }
            ++i;
        }
    }
    return open.empty() ? "" : "never closed: " + open.back();
}

}  // namespace narpa::rehearsal
