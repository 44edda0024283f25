/// base/text/read_number.h - parses numbers.
#pragma once

#include <charconv>
#include <string_view>

namespace narpa {

/// True if the whole text is a number. `base`: the radix of an integer.
template <class... Base>
[[nodiscard]] bool read_number(std::string_view text, auto& value, Base... base) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base...);
    return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace narpa
