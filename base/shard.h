/// base/shard.h - one of M parts of work that is numbered from 0, for processes on one machine or on several.
#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"

namespace narpa {

/// The items whose number is `index` modulo `count`.
struct Shard {
    std::uint32_t index = 0, count = 1;  ///< 0 <= index < count
    [[nodiscard]] bool has(std::uint32_t item) const { return item % count == index; }
    /// "2/8" is the second of eight.
    [[nodiscard]] std::string text() const { return std::to_string(index + 1) + "/" + std::to_string(count); }
};

/// The inverse of Shard::text. Error: expected K/M with 1 <= K <= M.
[[nodiscard]] inline Result<Shard> shard_from(const std::string& text) {
    Shard shard;
    const std::size_t slash = text.find('/') == std::string::npos ? text.size() : text.find('/');
    const char *const first = text.data(), *const last = first + text.size();
    const char* const second = slash < text.size() ? first + slash + 1 : last;
    const auto [k_end, k_error] = std::from_chars(first, first + slash, shard.index);
    const auto [m_end, m_error] = std::from_chars(second, last, shard.count);
    if (k_error != std::errc{} || m_error != std::errc{} || k_end != first + slash || m_end != last ||
        shard.index < 1 || shard.index > shard.count)
        return Error{"--shard \"" + text + "\", expected K/M with 1 <= K <= M, like 2/8"};
    --shard.index;
    return shard;
}

/// Of `count` shards those that have one of the items, in ascending order.
[[nodiscard]] inline std::vector<Shard> shards_with(const std::vector<std::uint32_t>& items, std::uint32_t count) {
    std::vector<bool> wanted(count, false);
    for (const std::uint32_t item : items) wanted[item % count] = true;
    std::vector<Shard> shards;
    for (std::uint32_t k = 0; k < count; ++k)
        if (wanted[k]) shards.push_back({k, count});
    return shards;
}

}  // namespace narpa
