/// renderer/assets/yaml_file.h - reads a YAML file whose content may be wrong at one of its lines.
#pragma once

#include <yaml-cpp/yaml.h>

#include <fstream>
#include <sstream>
#include <string>

#include "base/result.h"

namespace narpa {

/// Wrong content of the file, at one of its lines: thrown by what read_yaml calls.
struct YamlFault {
    std::string what;
    YAML::Mark at = YAML::Mark::null_mark();
};

/// Returns `read(document)` for a file that holds a map. Errors name the file and the line. `expected`: "a
/// calibration in YAML, ...".
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
        const YAML::Node document = YAML::Load(text);
        if (!document.IsMap()) return Error{"expected " + expected, file};
        return read(document);
    } catch (const YamlFault& fault) {
        return at(fault.what, fault.at);
    } catch (const YAML::Exception& wrong) {
        return at("is not YAML: " + wrong.msg, wrong.mark);
    }
}

}  // namespace narpa
