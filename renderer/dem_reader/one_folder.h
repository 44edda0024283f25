/// renderer/dem_reader/one_folder.h - a virtual file system for GDAL that holds the files of one folder and nothing
/// else.
#pragma once

#include <string>

namespace narpa {

/// Prefix of its file names.
inline constexpr const char* kOneFolder = "/narpa-dem/";

/// Installs the file system and returns the name under which GDAL opens `path` and finds the files that a label
/// names. Names such as `../../etc/passwd` or `/vsicurl/http://...` in a file cannot be opened: it holds only
/// regular files whose names have no slash.
std::string open_in_one_folder(const std::string& path);

}  // namespace narpa
