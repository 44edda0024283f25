/// renderer/keys/based_on.h - TOML files that hold only their differences from another.
#pragma once

#include <toml++/toml.h>

#include <string>

#include "base/result.h"

namespace narpa {

/// The path of a file that `file` names relative to its own folder.
[[nodiscard]] std::string beside(const std::string& file, const std::string& named);

/// Parses a file and, where its table `head` has a key `based_on`, the file that this names: keys that the first
/// file leaves out are taken from there, table by table; arrays (of tables, too) as a whole. Nodes keep their
/// source locations. Errors: files that cannot be read or nest too deep, a chain of more than eight files, a
/// `based_on` outside of `head`. Throws toml::parse_error.
Result<toml::table> parse_based_on(const std::string& path, const std::string& head);

}  // namespace narpa
