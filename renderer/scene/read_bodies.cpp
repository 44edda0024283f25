#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "renderer/scene/scene_parts.h"

namespace narpa {

namespace {

/// DESIGN of the CAN identifiers: each body has sixteen, from a base that is a multiple of 16.
constexpr std::int64_t kIdsPerBody = 16, kLastBaseId = 0x5f0;

void check_energy(TableReader& table, const Material& m) {
    for (int b = 0; b < 3; ++b)
        if (m.diffuse[b] + m.specular[b] > 1.0f + 1e-6f) {
            table.fail("specular", fmt::format("albedo + specular is {} in band {}, expected at most 1: a surface "
                                               "cannot send back more than it gets",
                                               m.diffuse[b] + m.specular[b], b));
            return;
        }
}

/// `material = {...}` of a body; its index, or nullopt where there is none.
std::optional<int> read_material(TableReader& body, const std::string& name, SceneReading& reading) {
    using enum Material::Kind;
    static constexpr std::array<std::pair<std::string_view, Material::Kind>, 2> kKinds{
        {{"lambert", lambert}, {"phong", phong}}};
    auto table = body.table("material");
    if (!table) return std::nullopt;
    Material m;
    m.name = name;
    m.kind = table->choice<Material::Kind>("kind", kKinds).value_or(lambert);
    m.diffuse = table->rgb("albedo", kUnit).value_or(m.diffuse);
    m.specular = table->rgb("specular", kUnit).value_or(Rgb{});
    m.exponent = static_cast<float>(table->number("exponent", {.low = 0, .high = 1e4}).value_or(1));
    m.emission = table->rgb("emission", {.low = 0, .high = 1e30}).value_or(Rgb{});
    if (m.kind == phong) {
        table->require("specular", "a number or [r, g, b] in [0, 1], as the kind is \"phong\"");
        table->require("exponent", "a number in [0, 10000], as the kind is \"phong\"");
        check_energy(*table, m);
    } else {
        for (const char* key : {"specular", "exponent"})
            if (table->has(key)) table->fail(key, "belongs to kind = \"phong\", and this is \"lambert\"");
    }
    const int index = static_cast<int>(reading.scene.materials.size());
    if (const auto file = table->text("texture"))
        reading.textures.push_back({index, (reading.folder / *file).string(), table->place("texture")});
    table->finish();
    reading.scene.materials.push_back(std::move(m));
    return index;
}

int grey_material(const std::string& name, Scene& scene) {
    scene.materials.push_back({.name = name});
    return static_cast<int>(scene.materials.size()) - 1;
}

void read_shape(TableReader& table, Body& body, SceneReading& reading) {
    const std::optional<int> material = read_material(table, body.name, reading);
    const auto mesh = table.text("mesh");
    auto sphere = table.table("sphere");
    const auto scale = table.number("scale", {.low = 0, .high = 1e12, .low_open = true});
    table.not_in_this_version("ellipsoid", "give a sphere or a mesh");
    table.not_in_this_version("dem", "give a mesh");
    if (table.has("mesh") && table.has("sphere")) {
        table.fail("sphere", "this body has a mesh already, expected one of the two");
    } else if (!table.has("mesh") && !table.has("sphere") && !table.has("ellipsoid") && !table.has("dem")) {
        table.require("mesh", "mesh = \"FILE\" or sphere = {radius_m = ...}");
    }
    if (sphere) {
        sphere->require("radius_m", "a number > 0");
        const double radius_m = sphere->number("radius_m", {.low = 0, .high = 1e15, .low_open = true}).value_or(1);
        sphere->finish();
        if (scale) table.fail("scale", "belongs to a mesh; a sphere has its radius_m");
        body.shape = Sphere{radius_m, material ? *material : grey_material(body.name, reading.scene)};
    } else if (mesh) {
        if (mesh->empty()) table.fail("mesh", "expected the name of a mesh file");
        reading.meshes.push_back({.body = reading.scene.bodies.size(),
                                  .path = (reading.folder / *mesh).string(),
                                  .scale = scale.value_or(1),
                                  .material = material,
                                  .place = table.place("mesh")});
    }
}

void read_can_id(TableReader& table, Body& body, const std::vector<Body>& others) {
    const auto id = table.integer("can_id", 0, kLastBaseId);
    if (!id) return;
    if (*id % kIdsPerBody != 0) {
        table.fail("can_id",
                   fmt::format("0x{:03x} is not a base identifier, expected a multiple of 16: a body takes "
                               "sixteen identifiers from there",
                               *id));
        return;
    }
    body.can_id = static_cast<std::uint32_t>(*id);
    for (const Body& other : others)
        if (other.can_id == body.can_id)
            table.fail("can_id",
                       fmt::format("0x{:03x} is taken by body \"{}\", expected one of its own", *id, other.name));
}

void read_motion(TableReader& table, Motion& motion) {
    motion.T_world_body.t = table.vec3("position_m").value_or(Vec3{});
    motion.T_world_body.q = table.attitude("attitude_wxyz").value_or(Quat{});
    motion.velocity_m_s = table.vec3("velocity_m_s").value_or(Vec3{});
    motion.rate_rad_s = table.vec3("rate_rad_s").value_or(Vec3{});
}

}  // namespace

void read_bodies(TableReader& root, SceneReading& reading) {
    std::vector<std::string> names;
    for (TableReader& table : root.tables("body")) {
        Body body;
        body.name = read_name(table, names);
        read_shape(table, body, reading);
        read_motion(table, body.initial);
        read_can_id(table, body, reading.scene.bodies);
        table.finish();
        reading.scene.bodies.push_back(std::move(body));
    }
    root.require("body", "at least one [[body]]");
}

}  // namespace narpa
