/// base/text/text_number.h - numbers as programs of all kinds write them into text files.
#pragma once

#include <charconv>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace narpa {

namespace text_number {

inline bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/// A number as std::from_chars reads it, which the whole token must be.
inline std::optional<double> plain(std::string_view token) {
    double x = 0;
    const auto [end, problem] = std::from_chars(token.data(), token.data() + token.size(), x);
    if (end != token.data() + token.size() || token.empty()) return std::nullopt;
    if (problem == std::errc::result_out_of_range)  // either way; an exponent below zero has a minus sign
        return token.find("e-") == token.npos && token.find("E-") == token.npos
                   ? std::numeric_limits<double>::infinity()
                   : 0.0;
    return problem == std::errc() ? std::optional(x) : std::nullopt;
}

/// Fortran's: 1.5D+00, 1.5d3, and 1.5-101, whose exponent of three digits leaves no room for the letter.
inline std::optional<double> fortran(std::string_view token) {
    std::string text(token);
    const std::size_t letter = text.find_first_of("dD");
    if (letter != std::string::npos && letter > 0) {
        text[letter] = 'e';
        if (letter + 1 < text.size() && text[letter + 1] == '+') text.erase(letter + 1, 1);
        return plain(text);
    }
    const std::size_t n = text.size(), sign = n >= 4 ? n - 4 : 0;
    const bool has_exponent = sign > 0 && (text[sign] == '-' || text[sign] == '+') &&
                              (is_digit(text[sign - 1]) || text[sign - 1] == '.') && is_digit(text[n - 3]) &&
                              is_digit(text[n - 2]) && is_digit(text[n - 1]) && text.find('.') != std::string::npos;
    if (!has_exponent) return std::nullopt;
    if (text[sign] == '+') text.erase(sign, 1);
    return plain(text.insert(sign, 1, 'e'));
}

/// Microsoft's: 1.#INF, -1.#IND, 1.#QNAN, 1.#SNAN, with further digits.
inline std::optional<double> microsoft(std::string_view token) {
    const bool is_negative = token.starts_with('-');
    if (is_negative) token.remove_prefix(1);
    if (!token.starts_with("1.#")) return std::nullopt;
    token.remove_prefix(3);
    while (!token.empty() && is_digit(token.back())) token.remove_suffix(1);
    if (token == "INF") return (is_negative ? -1 : 1) * std::numeric_limits<double>::infinity();
    if (token == "IND" || token == "QNAN" || token == "SNAN") return std::numeric_limits<double>::quiet_NaN();
    return std::nullopt;
}

}  // namespace text_number

/// The number that a token is, NaN and infinity included; nullopt when it is none.
inline std::optional<double> number_from(std::string_view token) {
    if (token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+') token.remove_prefix(1);
    if (const auto x = text_number::plain(token)) return x;
    if (const auto x = text_number::fortran(token)) return x;
    return text_number::microsoft(token);
}

}  // namespace narpa
