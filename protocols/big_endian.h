/// protocols/big_endian.h - integers to and from bytes in network order, byte by byte, whatever the machine.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

namespace narpa {

/// Writes sizeof(T) bytes at `at`, most significant first.
template <std::unsigned_integral T>
constexpr void put_be(std::uint8_t* at, T value) noexcept {
    for (std::size_t i = 0; i < sizeof(T); ++i)
        at[i] = static_cast<std::uint8_t>(value >> (8 * (sizeof(T) - 1 - i)));
}

/// Reads sizeof(T) bytes at `at`, most significant first.
template <std::unsigned_integral T>
[[nodiscard]] constexpr T get_be(const std::uint8_t* at) noexcept {
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i)
        value = static_cast<T>(value | static_cast<T>(T{at[i]} << (8 * (sizeof(T) - 1 - i))));
    return value;
}

}  // namespace narpa
