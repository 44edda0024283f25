#include "renderer/assets/meshes/mesh_process.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
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
    const auto in = [](std::uint32_t index, std::size_t size) {
        return index == TriangleSoup::kNone || index < size;
    };
    for (const TriangleSoup::Triangle& t : s.triangles) {
        if (t.material >= s.materials.size()) return false;
        for (const TriangleSoup::Corner& c : t.corners)
            if (c.position >= s.positions.size() || !in(c.uv, s.uvs.size()) || !in(c.normal, s.normals.size()) ||
                !in(c.colour, s.colours.size()))
                return false;
    }
    return true;
}

}  // namespace

bool is_read_in_process(const std::string& extension) {
    constexpr std::array kAll{".gltf", ".glb", ".ply", ".stl", ".3ds", ".dae"};
    return std::find(kAll.begin(), kAll.end(), extension) != kAll.end();
}

Result<TriangleSoup> read_soup_in_process(const std::string& path, const MeshReaderLimits& limits) {
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
