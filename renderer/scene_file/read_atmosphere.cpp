#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderer/atmosphere/air_kind.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr Range kAirHeight{.low = 100, .high = 1e5};
constexpr TableKey kAtmosphereRows[]{
    {"body", rows::text(), "the name of the [[body]] that the air surrounds"},
    {"planet", rows::kind("earth")},
    {"top_m", rows::number({.low = 1e4, .high = 5e5})},
    {"gas_height_m", rows::number(kAirHeight)},
    {"aerosol_height_m", rows::number(kAirHeight)},
    {"gas_amount", rows::number({.low = 0, .high = 100})},
    {"lidar_ratio_sr", rows::number({.low = 1, .high = 1000})},
    {"ground_albedo", rows::number(kUnit)},
    {"ground_radius_m", rows::number({.low = 1e5, .high = 1e9})},
    {"samples_per_band", rows::integer(1, Air::kMaxPerBand)},
    {"steps", rows::integer(4, 32)},
};

/// Radius of the sphere with the body's volume; nullopt for other shapes.
std::optional<double> mean_radius_m(const Body& body) {
    const auto axes = semi_axes_m(body);
    if (!axes) return std::nullopt;
    const auto [a, b, c] = *axes;
    return a == b && b == c ? a : std::cbrt(a * b * c);  // a cubic root rounds
}

/// Index of the body that is named; -1 and a problem otherwise.
int planet_body(TableReader& table, const std::vector<Body>& bodies) {
    const auto name = table.text("body");
    if (!name) return -1;
    for (std::size_t i = 0; i < bodies.size(); ++i)
        if (bodies[i].name == *name) return static_cast<int>(i);
    table.fail("body", fmt::format("there is no body \"{}\", expected the name of a [[body]]", *name));
    return -1;
}

/// Whether the material names a texture. Texture files are opened after everything else.
bool names_texture(const SceneReading& reading, int material) {
    return std::any_of(reading.textures.begin(), reading.textures.end(),
                       [&](const NamedTexture& t) { return t.material == material; });
}

void read_ground(TableReader& table, const Body& body, const SceneReading& reading, AirDescription& air) {
    const std::optional<double> own = mean_radius_m(body);
    const auto radius = table.number("ground_radius_m");
    if (own && radius)
        table.fail("ground_radius_m", "the body has a radius of its own, expected none here");
    else if (own && !(*own >= 1e5 && *own <= 1e9))
        table.fail("body", fmt::format("its radius is {} m, expected a planet, of 1e5 to 1e9 m", *own));
    else if (!own && !table.has("ground_radius_m"))
        table.require("ground_radius_m", "the radius of the ground about the body's origin: the body is no sphere");
    air.ground_radius_m = own.value_or(radius.value_or(air.ground_radius_m));
    if (own && !table.has("ground_albedo")) {
        const int material = std::get<ExactShape>(body.shape).material;
        const Material& m = reading.scene.materials[static_cast<std::size_t>(material)];
        if (m.kind == &kinds::lambert && !names_texture(reading, material))
            air.ground_albedo = std::min(1.0, static_cast<double>(mean_band(m.diffuse)));
    }
    table.read("ground_albedo", air.ground_albedo);
}

void read_air(TableReader& table, AirDescription& air) {
    table.read("top_m", air.top_m);
    table.read("gas_height_m", air.gas_height_m);
    table.read("aerosol_height_m", air.aerosol_height_m);
    table.read("gas_amount", air.gas_amount);
    table.read("lidar_ratio_sr", air.aerosol_lidar_ratio_sr);
    air.kind->read(table, air);
}

}  // namespace

constinit const TableKeys kAtmosphereKeys{.rows = kAtmosphereRows, .kinds = kinds_of<air_kinds>};

void read_atmosphere(TableReader& root, SceneReading& reading) {
    auto table = root.table("atmosphere");
    if (!table) return;
    Atmosphere a;
    Scene& scene = reading.scene;
    a.body = planet_body(*table, scene.bodies);
    a.air = air_kinds()[table->kind().value_or(0)]->standard();
    if (a.body >= 0) read_ground(*table, scene.bodies[static_cast<std::size_t>(a.body)], reading, a.air);
    read_air(*table, a.air);
    table->read("samples_per_band", a.samples_per_band);
    table->read("steps", a.steps);
    table->finish();
    if (a.body >= 0) scene.atmosphere = a;
}

}  // namespace narpa
