/// protocols/can/hex.h - hexadecimal digits, as slcan and candump lines carry them.
#pragma once

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
    if (text.empty() || text.size() > 8) return false;
    std::uint32_t value = 0;
    for (const char c : text) {
        std::uint32_t digit = 0;
        if (c >= '0' && c <= '9')
            digit = static_cast<std::uint32_t>(c - '0');
        else if (c >= 'A' && c <= 'F')
            digit = static_cast<std::uint32_t>(c - 'A' + 10);
        else if (c >= 'a' && c <= 'f')
            digit = static_cast<std::uint32_t>(c - 'a' + 10);
        else
            return false;
        value = value << 4 | digit;
    }
    out = value;
    return true;
}

[[nodiscard]] inline bool get_hex_byte(std::string_view two_digits, std::uint8_t& out) noexcept {
    std::uint32_t value = 0;
    if (!get_hex(two_digits, value)) return false;
    out = static_cast<std::uint8_t>(value);
    return true;
}

}  // namespace narpa
