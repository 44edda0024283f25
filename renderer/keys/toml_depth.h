/// renderer/keys/toml_depth.h - bounds how deep a TOML text nests, before it is parsed: the parser and its tables
/// recurse.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

/// Most parts of a dotted key or table header, and most levels of arrays and inline tables.
inline constexpr int kDeepestToml = 32;

/// An error, with line and column, where the text goes deeper. Whatever else is wrong with it is left to the
/// parser.
Status check_toml_depth(std::string_view text, const std::string& file);

}  // namespace narpa
