/// base/file_bytes.h - a whole file in memory.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "base/result.h"

namespace narpa {

/// Errors: no such file, not a plain file.
inline Status check_plain_file(const std::string& path) {
    std::error_code problem;
    const auto status = std::filesystem::status(path, problem);
    if (!std::filesystem::exists(status)) return Error{.what = "no such file", .file = path};
    if (!std::filesystem::is_regular_file(status)) return Error{.what = "not a plain file", .file = path};
    return Ok{};
}

/// Errors: those of check_plain_file; larger than 2 GB; not readable.
inline Result<std::string> read_file(const std::string& path) {
    if (const Status plain = check_plain_file(path); !plain) return plain.error();
    std::error_code problem;
    const auto size = std::filesystem::file_size(path, problem);
    if (problem || size > 0x7fff'ffffu)
        return Error{.what = "larger than 2 GB, which is not supported", .file = path};
    std::string bytes(size, '\0');
    std::ifstream in(path, std::ios::binary);
    in.read(bytes.data(), static_cast<std::streamsize>(size));
    if (!in) return Error{.what = "cannot be read; check its permissions", .file = path};
    return bytes;
}

}  // namespace narpa
