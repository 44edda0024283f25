/// renderer/keys/other_names.h - suggests known keys for an unknown one.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

/// Another tool's name for the quantity of these scene file keys; lower case without underscores.
struct OtherName {
    std::string_view name;
    std::vector<std::string_view> keys;
};
[[nodiscard]] std::span<const OtherName> other_names();

/// "; did you mean "rate_hz"?", or nothing: those of a table's `known` keys for which another tool uses this name,
/// else the one with nearly this spelling, else one that only ends in another unit.
[[nodiscard]] std::string key_meant(std::string_view unknown, const std::vector<std::string>& known);

/// The same for the words that a key takes: V4L2's and ROS's names of pixel formats, else the nearest spelling.
[[nodiscard]] std::string word_meant(std::string_view unknown, const std::vector<std::string_view>& words);

}  // namespace narpa
