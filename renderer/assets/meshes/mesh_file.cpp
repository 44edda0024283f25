#include "renderer/assets/meshes/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/file_bytes.h"
#include "renderer/assets/meshes/mesh_builder.h"
#include "renderer/assets/meshes/mesh_process.h"
#include "renderer/assets/meshes/mesh_readers.h"
#include "renderer/assets/meshes/smooth_normals.h"

namespace narpa {

namespace {

/// A texture needs coordinates: triangles without them get the material without it.
void take_textures_off_bare_triangles(TriangleSoup& soup, const std::string& path) {
    const std::size_t given = soup.materials.size();
    std::vector<std::size_t> bare(given, 0);  // the material without its texture; 0 is none yet
    if (std::ranges::none_of(soup.materials, &MeshMaterial::has_textures)) return;
    for (std::size_t i = 0; i < soup.triangles.size(); ++i) {
        const TriangleSoup::Triangle t = soup.triangles[i];
        const bool has_uvs = std::all_of(t.corners.begin(), t.corners.end(),
                                         [](const auto& c) { return c.uv != TriangleSoup::kNone; });
        if (has_uvs || !soup.materials[t.material].has_textures()) continue;
        std::size_t& without = bare[t.material];
        if (without == 0) {
            if (soup.materials.size() >= kMaxMaterials) return;
            without = soup.materials.size();
            soup.warnings.push_back(
                fmt::format("{}: triangles of material \"{}\" have no texture coordinates; its "
                            "textures are not used on them",
                            path, soup.materials[t.material].material.name));
            soup.materials.push_back({.material = soup.materials[t.material].material,
                                      .is_grey_by_default = soup.materials[t.material].is_grey_by_default});
        }
        soup.triangles.set_material(i, static_cast<std::uint16_t>(without));
    }
}

/// Triangles with a colour at each corner get their material with vertex colours.
void use_vertex_colours(TriangleSoup& soup, const std::string& path) {
    if (soup.colours.empty()) return;
    std::vector<std::size_t> coloured(soup.materials.size(), 0);  // the material with vertex colours; 0 is none yet
    std::size_t partly = 0;
    for (std::size_t i = 0; i < soup.triangles.size(); ++i) {
        const TriangleSoup::Triangle t = soup.triangles[i];
        const auto given =
            std::ranges::count_if(t.corners, [](const auto& c) { return c.colour != TriangleSoup::kNone; });
        partly += given == 1 || given == 2;
        if (given < 3) continue;
        std::size_t& with = coloured[t.material];
        if (with == 0) {
            if (soup.materials.size() >= kMaxMaterials)
                return soup.warnings.push_back(path + ": has too many materials for vertex colours on all of them");
            with = soup.materials.size();
            MeshMaterial m = soup.materials[t.material];
            m.material.vertex_colours = 0;
            if (m.is_grey_by_default) m.material.diffuse = {1, 1, 1};
            soup.materials.push_back(std::move(m));
        }
        soup.triangles.set_material(i, static_cast<std::uint16_t>(with));
    }
    if (partly > 0)
        soup.warnings.push_back(
            fmt::format("{}: {} triangle{} with colours at some corners only: they are not used", path, partly,
                        partly > 1 ? "s" : ""));
}

void warn_of_dropped(MeshFile& file, const std::string& path) {
    const auto warn = [&](std::size_t count, std::string_view kind) {
        if (count > 0)
            file.warnings.push_back(
                fmt::format("{}: {} {} triangle{} dropped", path, count, kind, count > 1 ? "s" : ""));
    };
    warn(file.non_finite, "not finite (NaN or infinite coordinates)");
    warn(file.degenerate, "degenerate (without area)");
    warn(file.duplicate, "duplicated");
}

}  // namespace

Result<MeshFile> read_mesh(const std::string& path, double scale, double crease_rad,
                           const MeshReaderLimits& limits) {
    if (const Status plain = check_plain_file(path); !plain) return plain.error();
    const std::string extension = extension_of(path);
    const bool is_obj = extension == ".obj", is_plates = extension == ".tab", is_icq = extension == ".icq";
    if (!is_obj && !is_plates && !is_icq && !is_read_in_process(extension))
        return Error{.what = fmt::format("not a mesh format that can be read, expected {}", kMeshExtensions),
                     .file = path};
    Result<TriangleSoup> soup = is_obj      ? read_obj(path)
                                : is_plates ? read_plates(path)
                                : is_icq    ? read_icq(path)
                                            : read_soup_in_process(path, limits);
    if (!soup) return soup.error();
    take_textures_off_bare_triangles(*soup, path);
    use_vertex_colours(*soup, path);
    if (soup->triangles.empty())
        return Error{.what = "no triangles in it, expected a mesh with faces", .file = path};
    const std::size_t given = soup->triangles.size();
    if (given > kMostTriangles)
        return Error{.what = fmt::format("{} triangles, expected at most {}", given, kMostTriangles), .file = path};
    if (crease_rad > 0 && soup->normals.empty())
        add_smooth_normals(*soup, crease_rad);
    else if (soup->has_smoothing_groups && crease_rad == 0)
        soup->warnings.push_back(path + ": smoothing groups (s) are not used; crease_angle_deg smooths edges");
    else if (crease_rad > 0)
        soup->warnings.push_back(path + ": has normals of its own, crease_angle_deg is not used");
    float reach_m = 0;
    MeshFile file = build_mesh(*std::move(soup), scale, reach_m);
    file.mesh.name = path;
    if (reach_m > kMeshReach_m)
        return Error{
            .what = fmt::format("reaches to {:.3g} m, expected coordinates of at most {:g} m, scale included",
                                reach_m, kMeshReach_m),
            .file = path};
    if (file.mesh.faces.empty())
        return Error{.what = fmt::format("none of its {} triangles can be used: {} not finite, {} degenerate",
                                         given, file.non_finite, file.degenerate),
                     .file = path};
    warn_of_dropped(file, path);
    return file;
}

}  // namespace narpa
