/// apps/warnings.h - warnings on standard error, which --strict makes errors.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "apps/options.h"
#include "base/result.h"

namespace narpa::cli {

/// Prints "warning: TEXT" and counts it. For the thread that runs the command.
void warn(std::string_view text);

/// The texts so far.
[[nodiscard]] const std::vector<std::string>& warnings();

/// Adds --strict.
Option add_strict_to(Parser app);
/// With --strict after a warning: an Error that names the file, of exit status 1; else Ok.
[[nodiscard]] Status check_warnings(const std::string& file = {});

}  // namespace narpa::cli
