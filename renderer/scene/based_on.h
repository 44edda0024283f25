/// renderer/scene/based_on.h - TOML files that hold only their differences from another.
#pragma once

#include <toml++/toml.h>

#include <string>

#include "base/result.h"

namespace narpa {

/// A file named in another one, which it lies beside.
[[nodiscard]] std::string beside(const std::string& file, const std::string& named);

/// Parses a file and, where its table `head` has a key `based_on`, the file that this names: what the first leaves
/// out is taken from there, table by table and key by key; arrays (of tables too) as a whole. Nodes keep the place
/// that they come from. Errors: files that cannot be read or nest too deep, more than eight one on another,
/// a `based_on` outside of `head`. Throws
/// toml::parse_error.
Result<toml::table> parse_based_on(const std::string& path, const std::string& head);

}  // namespace narpa
