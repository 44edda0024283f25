/// base/write_file.h - writes a whole file; names the JSON document beside a file.
#pragma once

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

/// The error of a file that could not be opened for writing, with the system's reason: call it before errno
/// changes.
[[nodiscard]] inline Error cannot_open_to_write(const std::string& path) {
    return {std::string("cannot be written: ") + std::strerror(errno), path, 0, 0, ErrorKind::missing};
}

/// FILE.json for FILE.png: the document that is written beside a picture or a capture.
[[nodiscard]] inline std::string document_beside(const std::string& file) {
    return std::filesystem::path(file).replace_extension(".json").string();
}

/// Errors: the file cannot be opened (`missing`), or not be written completely (`failed`).
[[nodiscard]] inline Status write_file(const std::string& path, std::string_view text) {
    std::ofstream out(path, std::ios::binary);
    if (!out) return cannot_open_to_write(path);
    out << text;
    if (!out.flush())
        return Error{std::string("cannot be written: ") + std::strerror(errno), path, 0, 0, ErrorKind::failed};
    return Ok{};
}

}  // namespace narpa
