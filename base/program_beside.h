/// base/program_beside.h - finds the narpa programs and shared libraries that a narpa program uses.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>

namespace narpa {

namespace detail {

inline std::filesystem::path& stated_program_folder() {
    static std::filesystem::path folder;
    return folder;
}

}  // namespace detail

/// Where narpa's programs are, for a library in a program of another folder (Python). Call before other threads
/// start.
inline void use_program_folder(std::filesystem::path folder) {
    detail::stated_program_folder() = std::move(folder);
}

/// The folder of the running program, or the one that was stated.
[[nodiscard]] inline std::filesystem::path program_folder() {
    if (!detail::stated_program_folder().empty()) return detail::stated_program_folder();
    std::error_code unknown;
    return std::filesystem::read_symlink("/proc/self/exe", unknown).parent_path();
}

/// Path of a program in the folder of the running one; if there is none, its bare name, which posix_spawnp searches
/// on PATH.
[[nodiscard]] inline std::string program_beside(const std::string& name) {
    std::error_code none;
    const std::filesystem::path beside = program_folder() / name;
    return std::filesystem::exists(beside, none) ? beside.string() : name;
}

/// Path of a shared library in the folder of the running program or, for it and for each folder of PATH, in
/// ../lib/narpa; if there is none, its bare name.
[[nodiscard]] inline std::string library_beside(const std::string& name) {
    std::error_code none;
    if (const auto beside = program_folder() / name; std::filesystem::exists(beside, none)) return beside.string();
    const char* const path = std::getenv("PATH");
    std::istringstream folders(program_folder().string() + ':' + (path != nullptr ? path : ""));
    for (std::string folder; std::getline(folders, folder, ':');) {
        const auto installed = std::filesystem::path(folder) / "../lib/narpa" / name;
        if (std::filesystem::exists(installed, none)) return installed.string();
    }
    return name;
}

}  // namespace narpa
