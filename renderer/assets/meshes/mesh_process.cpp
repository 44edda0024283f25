#include "renderer/assets/meshes/mesh_process.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <utility>

#include "renderer/assets/meshes/mesh_message.h"
#include "renderer/assets/reader_process.h"

namespace narpa {

namespace {

MeshMaterial checked(PlainMaterial&& m) {
    const PlainMaterial::Numbers& n = m.numbers;
    MeshMaterial out;
    switch (n.kind) {
        case PlainMaterial::Kind::glass: out.material = smooth_glass(std::move(m.name), n.ior, n.emission); break;
        case PlainMaterial::Kind::metallic_roughness:
            out.material =
                metallic_roughness(std::move(m.name), n.diffuse, n.metallic, n.roughness, n.ior, n.emission);
            break;
        default: out.material = diffuse_and_lobe(std::move(m.name), n.diffuse, n.specular, n.exponent, n.emission);
    }
    out.is_grey_by_default = n.is_grey_by_default;
    out.material.normal_scale = n.normal_scale > 0 ? std::min(n.normal_scale, 100.0f) : 0.0f;
    for (MeshTexture* t : {&m.colour, &m.emission, &m.normal})
        if (t->wrap != Texture::Wrap::clamp) t->wrap = Texture::Wrap::repeat;
    out.colour = std::move(m.colour), out.emission = std::move(m.emission), out.normal = std::move(m.normal);
    return out;
}

bool indices_are_sound(const TriangleSoup& s) {
    const auto below = [&](const TriangleSoup::Column& column, std::size_t size, bool may_be_none) {
        return std::ranges::all_of(column, [&](const auto& three) {
            return std::ranges::all_of(three, [&](std::uint32_t index) {
                return index < size || (may_be_none && index == TriangleSoup::kNone);
            });
        });
    };
    const TriangleSoup::Triangles& t = s.triangles;
    const auto fits = [&](const auto& column) { return column.empty() || column.size() == t.size(); };
    return fits(t.uv) && fits(t.normal) && fits(t.colour) && fits(t.materials) &&
           (t.empty() || !s.materials.empty()) && below(t.position, s.positions.size(), false) &&
           below(t.uv, s.uvs.size(), true) && below(t.normal, s.normals.size(), true) &&
           below(t.colour, s.colours.size(), true) &&
           std::ranges::all_of(t.materials, [&](std::uint16_t material) { return material < s.materials.size(); });
}

/// Larger files take more in proportion.
MeshReaderLimits scaled_to_size(const MeshReaderLimits& limits, const std::string& path) {
    constexpr std::uintmax_t kUnit = std::uintmax_t{512} << 20;
    std::error_code problem;
    const std::uintmax_t size = std::filesystem::file_size(path, problem), units = problem ? 1 : 1 + size / kUnit;
    return {.memory_bytes = limits.memory_bytes * units, .seconds = limits.seconds * static_cast<int>(units)};
}

}  // namespace

bool is_read_in_process(const std::string& extension) {
    constexpr std::array kAll{".gltf", ".glb", ".ply", ".stl", ".3ds", ".dae"};
    return std::find(kAll.begin(), kAll.end(), extension) != kAll.end();
}

Result<TriangleSoup> read_soup_in_process(const std::string& path, const MeshReaderLimits& given) {
    const MeshReaderLimits limits = scaled_to_size(given, path);
    ReaderProcess process;
    if (const int failed = process.start(
            "narpa-mesh-reader", {path, std::to_string(limits.memory_bytes), std::to_string(limits.seconds)});
        failed != 0)
        return Error{
            .what = fmt::format("cannot start narpa-mesh-reader, which reads it: {}, expected it beside the "
                                "program or on PATH",
                                std::strerror(failed)),
            .file = path,
            .kind = ErrorKind::missing};
    MeshMessage message;
    PipeReceiver receiver(process.output(), limits.memory_bytes, limits.seconds);
    const bool whole = mesh_message::transfer(receiver, message);
    const int status = process.end();
    const auto broken = [&](const std::string& what) {
        return Error{.what = what + "; the file is damaged or too large, expected it exported anew, or as OBJ",
                     .file = path};
    };
    if (receiver.timed_out()) return broken(fmt::format("the mesh reader took longer than {} s", limits.seconds));
    if (!whole) return broken(why_it_ended("the mesh reader", status, limits.memory_bytes));
    if (!message.error.empty())
        return Error{.what = message.error, .file = path, .line = message.line, .column = message.column};
    for (PlainMaterial& m : message.materials) message.soup.materials.push_back(checked(std::move(m)));
    if (message.materials.size() > kMaxMaterials || !indices_are_sound(message.soup))
        return broken("the mesh reader returned indices that are out of range");
    return std::move(message.soup);
}

}  // namespace narpa
