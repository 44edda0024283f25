#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr Range kBrightness{.low = 0, .high = 1e30}, kLightLength{.low = 0, .high = 1e12, .low_open = true};
constexpr TableKey kLightRows[]{
    kNameRow,
    {"kind", rows::kind(), "one of \"point\", \"directional\", \"rectangle\", \"disc\""},
    kMountRow,
    kPositionRow,
};
constexpr TableKey kRadianceRow{"radiance_w_m2_sr", rows::rgb(kBrightness), "a number or [r, g, b]"};
// The first row of each kind is its brightness.
constexpr TableKey kPointRows[]{{"intensity_w_sr", rows::rgb(kBrightness), "a number or [r, g, b]"}};
constexpr TableKey kDirectionalRows[]{
    {"irradiance_w_m2", rows::rgb(kBrightness), "a number or [r, g, b]"}, kAttitudeRow, kLookAtRow, kUpRow};
constexpr TableKey kRectangleRows[]{
    kRadianceRow, {"size_m", rows::pair(kLightLength), "[width, height]"}, kAttitudeRow, kLookAtRow, kUpRow};
constexpr TableKey kDiscRows[]{
    kRadianceRow, {"radius_m", rows::number(kLightLength), "a number > 0"}, kAttitudeRow, kLookAtRow, kUpRow};

/// In the order of Light::Kind.
std::vector<TableKind> light_kinds() {
    constexpr auto& names = Light::kKindNames;
    return {
        {names[0], kPointRows}, {names[1], kDirectionalRows}, {names[2], kRectangleRows}, {names[3], kDiscRows}};
}

Light read_light(TableReader& table, TakenNames& names, const std::vector<Body>& bodies) {
    Light light;
    light.name = read_name(table, names);
    const auto kind = table.kind();
    if (!kind) return light;  // its keys depend on the kind
    light.kind = static_cast<Light::Kind>(*kind);
    if (light.kind == Light::Kind::directional && !table.has("look_at"))
        table.refuse("position_m",
                     "a directional light shines from infinitely far; its position is used only with "
                     "look_at, to give its direction");
    const std::string_view brightness = light_kinds()[*kind].rows.front().name;
    const auto emission = table.rgb(brightness);
    light.emission = emission.value_or(Rgb{});
    if (emission && *emission == Rgb{}) table.fail(brightness, "got 0, expected a light that shines in some band");
    if (light.kind == Light::Kind::rectangle)
        if (const auto size = table.pair("size_m")) light.width_m = (*size)[0], light.height_m = (*size)[1];
    if (light.kind == Light::Kind::disc) table.read("radius_m", light.radius_m);
    const Mounting mounting = read_mounting(table, bodies, camera_attitude);
    light.mount = mounting.mount;
    light.T_mount_light = mounting.T_mount_sensor;
    table.finish();
    return light;
}

}  // namespace

constinit const TableKeys kLightKeys{.rows = kLightRows, .kinds = light_kinds};

void read_lights(TableReader& root, SceneReading& reading) {
    TakenNames names;
    for (TableReader& table : root.tables("light"))
        reading.scene.lights.push_back(read_light(table, names, reading.scene.bodies));
}

}  // namespace narpa
