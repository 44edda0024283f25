/// renderer/assets/yaml_file.h - reads a YAML file whose content may be wrong at one of its lines.
#pragma once

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace narpa {

/// Wrong content of the file, at one of its lines: thrown by what read_yaml calls.
struct YamlFault {
    std::string what;
    YAML::Mark at = YAML::Mark::null_mark();
};

/// Adds a warning for each key of a map that is not known. Throws where a key stands twice.
inline void warn_of_keys(const YAML::Node& map, std::span<const std::string_view> known,
                         std::vector<std::string>& warnings) {
    std::set<std::string> seen;
    for (const auto& entry : map) {
        const auto key = entry.first.as<std::string>("");
        if (!seen.insert(key).second) throw YamlFault{"\"" + key + "\" stands twice", entry.first.Mark()};
        if (std::ranges::find(known, key) == known.end())
            warnings.push_back("its key \"" + key + "\" is not known and not used");
    }
}

/// The number of documents with content. (YAML::LoadAll does not end on some damaged files.)
inline int documents_in(const std::string& text) {
    int documents = 0;
    bool empty = true;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with("---")) empty = true;
        const std::size_t content =
            line.starts_with("---") ? line.find_first_not_of(" \r", 3) : line.find_first_not_of(" \r");
        if (content == line.npos || line[content] == '#' || line[0] == '%') continue;
        if (std::exchange(empty, false)) ++documents;
    }
    return documents;
}

/// Returns `read(document, documents)` for a file whose first document is a map; `documents`: how many it holds.
/// Errors name the file and the line. `expected`: "a calibration in YAML, ...".
template <class T, class Read>
[[nodiscard]] Result<T> read_yaml(const std::string& file, const std::string& expected, const Read& read) {
    std::ifstream in(file, std::ios::binary);
    std::stringstream stream;
    if (!in || !(stream << in.rdbuf())) return Error{"cannot be read", file};
    const std::string text = stream.str();
    const auto at = [&](const std::string& what, const YAML::Mark& mark) {
        const bool known = !mark.is_null();
        return Error{what, file, known ? mark.line + 1 : 0, known ? mark.column + 1 : 0};
    };
    try {
        const YAML::Node document = YAML::Load(text);
        if (!document.IsMap()) return Error{"expected " + expected, file};
        return read(document, documents_in(text));
    } catch (const YamlFault& fault) {
        return at(fault.what, fault.at);
    } catch (const YAML::Exception& wrong) {
        return at("is not YAML: " + wrong.msg, wrong.mark);
    }
}

}  // namespace narpa
