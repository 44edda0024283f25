/// renderer/dem_reader/one_folder.h - a file system for GDAL that has the files of one folder and nothing else.
#pragma once

#include <string>

namespace narpa {

/// What names in it begin with.
inline constexpr const char* kOneFolder = "/narpa-dem/";

/// Installs it; the name by which GDAL opens this file, and finds what a label beside it names. What a file may
/// name
/// (`../../etc/passwd`, `/vsicurl/http://...`) is not in it: only regular files whose names have no slash are.
std::string open_in_one_folder(const std::string& path);

}  // namespace narpa
