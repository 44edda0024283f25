/// renderer/keys/json_schema.h - JSON schemas of TOML files, for editors.
#pragma once

#include <string>
#include <string_view>

#include "renderer/keys/keys.h"

namespace narpa {

/// The schema (draft 2020-12) with this title of files with these keys: types, ranges, choices, required keys, and
/// that keys without a row are errors. Rules between keys are not in it. A file that is `based_on` another has the
/// keys of both.
[[nodiscard]] std::string json_schema(const TableKeys& keys, std::string_view title);

}  // namespace narpa
