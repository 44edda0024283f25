#include "renderer/keys/shipped_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "base/program_beside.h"
#include "base/text/nearest_name.h"

namespace narpa {
namespace {

namespace fs = std::filesystem;

/// The first sentence of the comment at its top, or its title.
std::string about(const fs::path& file) {
    std::ifstream in(file);
    std::string text, line;
    while (std::getline(in, line) && line.starts_with("# ")) text += (text.empty() ? "" : " ") + line.substr(2);
    if (const std::size_t end = std::min(text.find(". "), text.find(": ")); end != std::string::npos)
        text.resize(end);
    if (text.ends_with('.')) text.pop_back();
    if (!text.empty()) return text;
    do {
        if (line.starts_with("title = \"")) return line.substr(9, line.rfind('"') - 9);
    } while (std::getline(in, line));
    return {};
}

/// Short name of a file: "docking" of docking/docking.toml and of the scenario rehearsal/docking.toml; else folder
/// and file.
std::string short_name(const fs::path& relative, FileKind kind) {
    const std::string folder = relative.parent_path().string(), stem = relative.stem().string();
    return folder == stem || (kind == FileKind::scenario && folder == "rehearsal") ? stem : folder + "/" + stem;
}

}  // namespace

fs::path shipped_folder() {
    std::error_code error;
    const fs::path program = program_folder();
    for (const char* folder : {"../scenes", "../share/narpa/scenes"})
        if (fs::path path = (program / folder).lexically_normal(); fs::is_directory(path, error)) return path;
    return {};
}

std::vector<ShippedFile> shipped_files(FileKind kind) {
    std::vector<ShippedFile> all;
    const fs::path folder = shipped_folder();
    std::error_code error;
    if (folder.empty()) return all;
    for (const auto& entry : fs::recursive_directory_iterator(folder, error))
        if (entry.path().extension() == ".toml" && kind_of(entry.path().string()) == kind)
            all.push_back({short_name(entry.path().lexically_relative(folder), kind), entry.path().string(),
                           about(entry.path())});
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    return all;
}

std::optional<FileKind> kind_of(const std::string& file) {
    constexpr int kLines = 10000;
    std::ifstream in(file);
    std::string line;
    std::optional<FileKind> kind;
    for (int i = 0; i < kLines && std::getline(in, line); ++i) {
        if (line.starts_with("[scenario]")) return FileKind::scenario;
        if (line.starts_with("[dataset]")) return FileKind::dataset;
        if (line.starts_with("[trajectory]")) return std::nullopt;  // its bodies are not those of a scene
        for (const char* table : {"[scene]", "[[body]]", "[[camera]]", "[[lidar]]"})
            if (line.starts_with(table)) kind = FileKind::scene;
    }
    return kind;
}

namespace {

/// What a file of each kind is, and what a command that expects it says of others.
struct FileKindTexts {
    std::string_view is;       ///< "is a scene"
    std::string_view expects;  ///< of a command that takes this kind
};
constexpr std::array<FileKindTexts, kFileKindWords.size()> kFileKindTexts{{
    {"is a scene", "expected a scene"},
    {"is a scenario",
     "expected a scenario, which names a scene and how it is flown (docs/rehearsal.md; `narpa list` "
     "has some)"},
    {"is the recipe of a data set", "expected a recipe of a data set (docs/datasets.md)"},
}};

/// What takes a file of this kind; `{0}` is its name.
constexpr std::array<const char*, kFileKindWords.size()> kTakenBy{
    "`narpa render {0}` and `narpa run {0}` take scenes",
    "`narpa rehearse {0}` flies it, and `narpa check {0}` names its scene",
    "`narpa dataset {0}` makes its images",
};

/// `given`, file or name, is of the kind `found`, not `expected`.
Error other_kind(FileKind expected, FileKind found, const std::string& given) {
    const auto row = static_cast<std::size_t>(found);
    return {fmt::format("{}, {}: {}", kFileKindTexts[row].is,
                        kFileKindTexts[static_cast<std::size_t>(expected)].expects,
                        fmt::format(fmt::runtime(kTakenBy[row]), given)),
            given};
}

}  // namespace

Result<std::string> find_file(FileKind kind, const std::string& file_or_name) {
    std::error_code error;
    if (fs::exists(file_or_name, error) && !fs::is_directory(file_or_name, error)) {
        const auto found = fs::is_regular_file(file_or_name, error) ? kind_of(file_or_name) : std::nullopt;
        if (found && *found != kind) return other_kind(kind, *found, file_or_name);
        return file_or_name;
    }
    return find_shipped(kind, file_or_name);
}

std::string own_or_shipped(const std::string& file) {
    std::error_code error;
    const fs::path folder = shipped_folder();
    if (file.empty() || folder.empty() || fs::exists(file, error)) return file;
    const fs::path shipped = folder / file;
    return fs::exists(shipped, error) ? shipped.string() : file;
}

Result<std::string> find_shipped(FileKind kind, const std::string& name) {
    const std::vector<ShippedFile> shipped = shipped_files(kind);
    std::vector<std::string> names, with_this_stem;
    for (const ShippedFile& s : shipped) {
        if (s.name == name) return s.file;
        if (fs::path(s.file).stem() == name) with_this_stem.push_back(s.file);
        names.push_back(s.name);
    }
    if (with_this_stem.size() == 1) return with_this_stem.front();
    for (std::size_t other = 0; other < kFileKindWords.size(); ++other)
        if (static_cast<FileKind>(other) != kind)
            for (const ShippedFile& s : shipped_files(static_cast<FileKind>(other)))
                if (s.name == name) return other_kind(kind, static_cast<FileKind>(other), name);
    return Error{fmt::format("no such file, expected a {0} file (TOML) or the name of a {0} that `narpa list` "
                             "shows{1}",
                             kFileKindWords[static_cast<std::size_t>(kind)],
                             did_you_mean(fs::path(name).stem().string(), names)),
                 name};
}

}  // namespace narpa
