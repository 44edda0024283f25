/// renderer/scene/other_names.h - the key that was meant by one that is not known.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

/// A name that other tools give to what keys of scene files state; small letters without underscores.
struct OtherName {
    std::string_view name;
    std::vector<std::string_view> keys;
};
[[nodiscard]] std::span<const OtherName> other_names();

/// "; did you mean "rate_hz"?", or nothing: those of a table's `known` keys that have another tool's name for it,
/// else the one with nearly this spelling, else one that only ends in another unit.
[[nodiscard]] std::string key_meant(std::string_view unknown, const std::vector<std::string>& known);

}  // namespace narpa
