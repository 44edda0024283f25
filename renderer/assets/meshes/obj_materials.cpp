// Materials of an OBJ file, from the MTL files that it names.
#include <fmt/format.h>

#include <filesystem>

#include "base/text/text_cursor.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

namespace {

class MaterialLibraries {
public:
    MaterialLibraries(const std::string& path, TriangleSoup& soup) : path_(path), soup_(soup) {}

    /// `mtllib` names one file, perhaps with spaces in it, or several.
    Status read(const std::string& names) {
        std::error_code problem;
        if (std::filesystem::exists(beside(names), problem)) return read_mtl(beside(names), known, soup_.warnings);
        TextCursor words(names, path_);
        words.next_line();
        for (std::string_view name = words.token(); !name.empty(); name = words.token()) {
            if (!std::filesystem::exists(beside(name), problem))
                soup_.warnings.push_back(fmt::format("{}: its material file {} is not there", path_, name));
            else if (Status status = read_mtl(beside(name), known, soup_.warnings); !status)
                return status;
        }
        return Ok{};
    }

    std::map<std::string, MeshMaterial> known{};

private:
    [[nodiscard]] std::string beside(std::string_view name) const { return texture_path(path_, std::string(name)); }

    const std::string& path_;
    TriangleSoup& soup_;
};

}  // namespace

Status read_obj_materials(const std::string& path, const std::vector<std::string>& libraries,
                          const std::vector<std::string>& names, TriangleSoup& soup) {
    MaterialLibraries all(path, soup);
    for (const std::string& library : libraries)
        if (Status status = all.read(library); !status) return status;
    std::string missing;
    for (const std::string& name : names) {
        const auto it = all.known.find(name);
        const bool is_known = it != all.known.end();
        if (!is_known && name != kObjDefaultMaterial) missing += (missing.empty() ? "\"" : ", \"") + name + "\"";
        soup.materials.push_back(is_known ? it->second
                                          : MeshMaterial{.material = {.name = name}, .is_grey_by_default = true});
    }
    if (!missing.empty())
        soup.warnings.push_back(
            fmt::format("{}: in none of its material files: {}; grey 0.5 is used", path, missing));
    return Ok{};
}

}  // namespace narpa
