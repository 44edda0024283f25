/// apps/print_error.h - text on standard error, whether or not somebody reads it.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace narpa::cli {

/// What standard error does not take is lost: fmt::print would throw, and end a run with its logs.
template <class... Values>
void print_error(fmt::format_string<Values...> format, Values&&... values) {
    const std::string text = fmt::format(format, std::forward<Values>(values)...);
    std::fwrite(text.data(), 1, text.size(), stderr);
}

}  // namespace narpa::cli
