#include <array>

#include "renderer/scene_file/kind_names.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr Range kLightLength{.low = 0, .high = 1e12, .low_open = true};

/// The key for the brightness of a light of this kind.
const char* emission_key(Light::Kind kind) {
    switch (kind) {
        case Light::Kind::point: return "intensity_w_sr";
        case Light::Kind::directional: return "irradiance_w_m2";
        case Light::Kind::rectangle:
        case Light::Kind::disc: return "radiance_w_m2_sr";
    }
    return "";
}

void refuse_foreign_keys(TableReader& table, std::string_view kind) {
    static const std::array<KindKeys, 4> kKeys{{
        {"point", {"intensity_w_sr"}},
        {"directional", {"irradiance_w_m2", "attitude_wxyz", "look_at", "up"}},
        {"rectangle", {"radiance_w_m2_sr", "size_m", "attitude_wxyz", "look_at", "up"}},
        {"disc", {"radiance_w_m2_sr", "radius_m", "attitude_wxyz", "look_at", "up"}},
    }};
    table.refuse_keys_of_other_kinds(kind, kKeys);
    if (kind == "directional" && !table.has("look_at"))
        table.refuse("position_m",
                     "a directional light shines from infinitely far; its position only says where "
                     "it looks from, with look_at");
}

void read_emission(TableReader& table, Light& light) {
    const char* const key = emission_key(light.kind);
    table.require(key, "a number or [r, g, b]");
    const auto emission = table.rgb(key, {.low = 0, .high = 1e30});
    light.emission = emission.value_or(Rgb{});
    if (emission && *emission == Rgb{}) table.fail(key, "got 0, expected a light that shines in some band");
}

void read_size(TableReader& table, Light& light) {
    if (light.kind == Light::Kind::rectangle) {
        table.require("size_m", "[width, height]");
        if (const auto size = table.pair("size_m", kLightLength))
            light.width_m = (*size)[0], light.height_m = (*size)[1];
    }
    if (light.kind == Light::Kind::disc) {
        table.require("radius_m", "a number > 0");
        light.radius_m = table.number("radius_m", kLightLength).value_or(light.radius_m);
    }
}

Light read_light(TableReader& table, std::vector<std::string>& names, const std::vector<Body>& bodies) {
    Light light;
    light.name = read_name(table, names);
    table.require("kind", "one of \"point\", \"directional\", \"rectangle\", \"disc\"");
    const auto kind = table.choice<Light::Kind>("kind", kLightKinds);
    if (!kind) return light;  // its keys depend on the kind
    light.kind = *kind;
    refuse_foreign_keys(table, name_of(*kind, kLightKinds));
    read_emission(table, light);
    read_size(table, light);
    const Mounting mounting = read_mounting(table, bodies, camera_attitude);
    light.mount = mounting.mount;
    light.T_mount_light = mounting.T_mount_sensor;
    table.finish();
    return light;
}

}  // namespace

void read_lights(TableReader& root, SceneReading& reading) {
    std::vector<std::string> names;
    for (TableReader& table : root.tables("light"))
        reading.scene.lights.push_back(read_light(table, names, reading.scene.bodies));
}

}  // namespace narpa
