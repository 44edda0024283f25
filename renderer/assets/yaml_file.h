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

/// Returns `read(documents)` for a file whose first document is a map; documents without content are left out.
/// Errors name the file and the line. `expected`: "a calibration in YAML, ...".
template <class T, class Read>
[[nodiscard]] Result<T> read_yaml(const std::string& file, const std::string& expected, const Read& read) {
    std::ifstream in(file, std::ios::binary);
    std::stringstream text;
    if (!in || !(text << in.rdbuf())) return Error{"cannot be read", file};
    const auto at = [&](const std::string& what, const YAML::Mark& mark) {
        const bool known = !mark.is_null();
        return Error{what, file, known ? mark.line + 1 : 0, known ? mark.column + 1 : 0};
    };
    try {
        std::vector<YAML::Node> documents = YAML::LoadAll(text);
        std::erase_if(documents, [](const YAML::Node& node) { return !node || node.IsNull(); });
        if (documents.empty() || !documents.front().IsMap()) return Error{"expected " + expected, file};
        return read(documents);
    } catch (const YamlFault& fault) {
        return at(fault.what, fault.at);
    } catch (const YAML::Exception& wrong) {
        return at("is not YAML: " + wrong.msg, wrong.mark);
    }
}

}  // namespace narpa
