/// base/program_beside.h - finds the narpa programs that another narpa program starts.
#pragma once

#include <filesystem>
#include <string>

namespace narpa {

/// The folder of the running program.
[[nodiscard]] inline std::filesystem::path program_folder() {
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

}  // namespace narpa
