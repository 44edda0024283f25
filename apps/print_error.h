/// apps/print_error.h - text on standard error; write errors are ignored.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace narpa::cli {

/// fmt::print would throw on a write error, which would end a run without its logs.
template <class... Values>
void print_error(fmt::format_string<Values...> format, Values&&... values) {
    const std::string text = fmt::format(format, std::forward<Values>(values)...);
    std::fwrite(text.data(), 1, text.size(), stderr);
}

}  // namespace narpa::cli
