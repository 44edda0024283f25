/// renderer/keys/shipped_file.h - scenes, scenarios and recipes of data sets: by path, or by the name of one that
/// comes with narpa.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace narpa {

enum class FileKind : std::uint8_t { scene, scenario, dataset };
/// Also the table at the top of a file of this kind that may have `based_on`.
inline constexpr std::array<std::string_view, 3> kFileKindWords{"scene", "scenario", "dataset"};

/// The folder of the scenes beside the program, in a build and when installed; empty: there is none.
[[nodiscard]] std::filesystem::path shipped_folder();

struct ShippedFile {
    std::string name;   ///< "docking", "craft/craft-and-ball"
    std::string file;   ///< its path
    std::string about;  ///< a sentence
};
/// All of one kind that lie beside the program, in a build and when installed, by name.
[[nodiscard]] std::vector<ShippedFile> shipped_files(FileKind kind);

/// The kind of a TOML file by its tables; empty where it is of no kind.
[[nodiscard]] std::optional<FileKind> kind_of(const std::string& file);
/// The path of a file, or of the shipped file with this name. Errors: no such file or name; a file of another
/// kind.
[[nodiscard]] Result<std::string> find_file(FileKind kind, const std::string& file_or_name);
/// The file itself or, where there is none, the one under shipped_folder(): "docking/approach.csv".
[[nodiscard]] std::string own_or_shipped(const std::string& file);
/// The path of the shipped file with this name.
[[nodiscard]] Result<std::string> find_shipped(FileKind kind, const std::string& name);

}  // namespace narpa
