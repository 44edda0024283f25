#include <algorithm>
#include <filesystem>

#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

std::string extension_of(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return extension;
}

std::string texture_path(const std::string& mesh_path, std::string name) {
    while (!name.empty() && (name.back() == ' ' || name.back() == '\r' || name.back() == '\t')) name.pop_back();
    std::replace(name.begin(), name.end(), '\\', '/');
    const auto folder = std::filesystem::path(mesh_path).parent_path();
    const auto as_written = folder / name;  // an absolute name is not changed
    const auto beside = folder / std::filesystem::path(name).filename();
    std::error_code problem;
    const bool other = !std::filesystem::exists(as_written, problem) && std::filesystem::exists(beside, problem);
    return (other ? beside : as_written).string();
}

}  // namespace narpa
