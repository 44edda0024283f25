/// protocols/can/hex.h - hexadecimal digits, as slcan and candump lines carry them.
#pragma once

#include <charconv>
#include <cstdint>
#include <string_view>

namespace narpa {

inline constexpr std::uint32_t kMaxStandardId = 0x7FF, kMaxExtendedId = 0x1FFFFFFF;

/// Writes `digits` upper-case digits and returns where they end.
inline char* put_hex(char* p, std::uint32_t value, int digits) noexcept {
    for (int i = digits - 1; i >= 0; --i) *p++ = "0123456789ABCDEF"[(value >> (4 * i)) & 15];
    return p;
}

/// One to eight digits, either case, and nothing else.
[[nodiscard]] inline bool get_hex(std::string_view text, std::uint32_t& out) noexcept {
    const char* const end = text.data() + text.size();
    return text.size() <= 8 && std::from_chars(text.data(), end, out, 16).ptr == end && !text.empty();
}

[[nodiscard]] inline bool get_hex_byte(std::string_view two_digits, std::uint8_t& out) noexcept {
    std::uint32_t value = 0;
    if (!get_hex(two_digits, value)) return false;
    out = static_cast<std::uint8_t>(value);
    return true;
}

}  // namespace narpa
