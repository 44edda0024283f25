/// base/write_file.h - a whole file at once.
#pragma once

#include <fstream>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

[[nodiscard]] inline Status write_file(const std::string& path, std::string_view text) {
    std::ofstream out(path, std::ios::binary);
    out << text;
    if (!out.flush()) return Error{"cannot be written", path, 0, 0, ErrorKind::failed};
    return Ok{};
}

}  // namespace narpa
