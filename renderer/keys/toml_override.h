/// renderer/keys/toml_override.h - values of single keys in place of a file's: `--set KEY=VALUE`.
///
/// KEY is the path of a key through the tables of a file, separated by dots. A table of a list `[[camera]]` has the
/// name that its key `name` holds, or its number from 0: camera.nav.detector.exposure_s, fault.0.from_s. VALUE is
/// as in TOML; texts, names of files and dates need no quotes.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "renderer/keys/keys.h"

namespace toml {
inline namespace v3 {
class table;
}  // namespace v3
}  // namespace toml

namespace narpa {

/// What the place of a value that an override gave begins with, in place of a file.
inline constexpr std::string_view kSetOption = "--set ";

/// "KEY=A,B" -> "KEY=A", "KEY=B"; commas within brackets and quotes do not count. Error: no key or no value.
[[nodiscard]] Result<std::vector<std::string>> values_of_override(const std::string& set);

/// The first part of the key: the table at the top of the file that it belongs to.
[[nodiscard]] std::string_view table_of_override(std::string_view set);

/// Puts the value of a "KEY=VALUE" into the parsed file, in tables that are made where they are absent. `keys`:
/// those of the file. Errors name the option, the unknown key or table, and the nearest known one; the value is
/// checked by the reader.
Status apply_override(const std::string& set, const TableKeys& keys, toml::table& root);

/// An error at the place of an override names the option alone, which has no lines.
[[nodiscard]] Error at_option(Error error);

}  // namespace narpa
