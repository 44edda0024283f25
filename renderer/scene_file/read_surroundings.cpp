#include <fmt/format.h>

#include <cmath>

#include "base/constants.h"
#include "renderer/ephemeris/sun_direction.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr TableKey kSceneRows[]{
    {"name", rows::text()}, {"based_on", rows::file()}, {"replaces", rows::texts()}, {"epoch", rows::date()}};
constexpr TableKey kSunRows[]{
    {"irradiance_w_m2", rows::number(kPositive)},
    {"angular_diameter_deg", rows::number({.low = 0, .high = 180, .high_open = true})},
    {"direction", rows::direction()},
};
constexpr TableKey kAmbientRows[]{
    {"radiance", rows::rgb({.low = 0, .high = 1e30}), "a number or [r, g, b], W m^-2 sr^-1"}};
constexpr TableKey kRenderRows[]{
    {"method", rows::choice<RenderSettings::kMethodNames>()},
    {"max_depth", rows::integer(1, 40)},
    {"spp", rows::integer(1, 65535)},
    {"budget_ms", rows::number({.low = 0.001, .high = 1e6})},
    {"budget_rays", rows::integer(1, 1'000'000'000'000)},
    {"keep_deadline", rows::boolean()},
    {"seed", rows::integer(0, INT64_MAX)},
    {"stale_after_s", rows::number(kPositive)},
    // Time stamps on the bus are unambiguous within 39 h.
    {"command_ahead_max_s", rows::number({.low = 0.001, .high = 140'000})},
};

constexpr TableKey kTimeRows[]{
    {"source", rows::choice<TimeSettings::kSourceNames>()},
    {"on_restart", rows::choice<TimeSettings::kOnRestartNames>()},
    {"ptp4l", rows::text()},
    {"ptp4l_domain", rows::integer(0, 255)},
};
constexpr Range kCanPeriod{.low = 0.001, .high = 3600};
constexpr TableKey kCanRows[]{
    {"sync_period_s", rows::number(kCanPeriod)}, {"time_period_s", rows::number(kCanPeriod)},
    {"time_id", rows::integer(0, 0x5FF)},        {"redundancy", rows::choice<CanSettings::kRedundancyNames>()},
    {"heartbeat_id", rows::integer(0, 0x7FF)},   {"heartbeat_timeout_s", rows::number(kCanPeriod)},
};

double julian_year(std::int64_t unix_ns) {
    constexpr double kJ2000_s = 946'728'000, kYear_s = 365.25 * 86400;  // leap seconds do not matter here
    return 2000 + (1e-9 * static_cast<double>(unix_ns) - kJ2000_s) / kYear_s;
}

bool read_scene_table(TableReader& root, Scene& scene) {
    scene.name = std::filesystem::path(scene.file).stem().string();
    auto table = root.table("scene");
    if (!table) return false;
    table->read("name", scene.name);
    scene.epoch_unix_ns = table->date("epoch").value_or(scene.epoch_unix_ns);
    table->finish();
    return table->has("epoch");
}

void read_sun(TableReader& root, Scene& scene, bool has_epoch) {
    auto table = root.table("sun");
    if (!table) return;
    Sun sun;
    table->read("irradiance_w_m2", sun.irradiance_w_m2);
    if (const auto d = table->number("angular_diameter_deg")) sun.angular_diameter_rad = *d * kPi / 180.0;
    if (const auto direction = table->direction("direction")) {
        sun.direction = *direction;
    } else if (!table->has("direction")) {
        if (has_epoch) {
            sun.direction = sun_direction_gcrs(scene.epoch_unix_ns);
        } else {
            table->require("direction", "a direction towards the Sun, or an \"epoch\" in [scene]");
        }
    }
    table->finish();
    scene.sun = sun;
}

void read_ambient(TableReader& root, Scene& scene) {
    auto table = root.table("ambient");
    if (!table) return;
    table->read("radiance", scene.ambient);
    table->finish();
}

/// One of spp, budget_ms and budget_rays.
void read_budget(TableReader& table, RenderSettings& render) {
    if (table.has("spp")) {
        for (const std::string_view budget : {"budget_ms", "budget_rays"})
            table.refuse(budget, "spp is given too, expected one of spp, budget_ms, budget_rays");
    } else if (table.has("budget_ms")) {
        table.refuse("budget_rays", "budget_ms is given too, expected one of spp, budget_ms, budget_rays");
    }
    table.read("spp", render.spp);
    if (const auto ms = table.number("budget_ms")) render.budget_ns = std::llround(*ms * 1e6);
    table.read("budget_rays", render.budget_rays);
}

void read_render(TableReader& root, Scene& scene) {
    auto table = root.table("render");
    if (!table) return;
    RenderSettings& render = scene.render;
    table->read("method", render.method);
    if (render.method == RenderSettings::Method::direct)
        table->refuse("max_depth", "belongs to method = \"path\", and this is \"direct\"");
    table->read("max_depth", render.max_depth);
    read_budget(*table, render);
    table->read("keep_deadline", render.keep_deadline);
    table->read("seed", render.seed);
    table->read("stale_after_s", render.stale_after_s);
    table->read("command_ahead_max_s", render.command_ahead_max_s);
    table->finish();
}

/// sun_path of unix(7) has 108 bytes, one of which ends the path.
bool is_socket_path(const std::string& path) {
    return path.starts_with('/') && path.size() < 108;
}

void read_time(TableReader& root, Scene& scene) {
    auto table = root.table("time");
    if (!table) return;
    table->read("source", scene.time.source);
    table->read("on_restart", scene.time.on_restart);
    // No error: a scene with its own socket also runs in lockstep, by --set 'time.source="free"'.
    if (scene.time.source != TimeSettings::Source::system)
        for (const std::string_view key : {"ptp4l", "ptp4l_domain"})
            if (table->has(key))
                scene.warnings.push_back(
                    fmt::format("{} of [time] has no effect: it belongs to source = \"system\"", key));
    table->read("ptp4l", scene.time.ptp4l);
    if (table->has("ptp4l") && !is_socket_path(scene.time.ptp4l))
        table->fail("ptp4l", "expected the absolute path of a socket, of at most 107 characters");
    table->read("ptp4l_domain", scene.time.ptp4l_domain);
    table->finish();
}

void read_can(TableReader& root, Scene& scene) {
    auto table = root.table("can");
    if (!table) return;
    CanSettings& can = scene.can;
    const auto read_seconds = [&](std::string_view key, std::int64_t& ns) {
        if (const auto s = table->number(key)) ns = std::llround(*s * 1e9);
    };
    read_seconds("sync_period_s", can.sync_period_ns);
    read_seconds("time_period_s", can.time_period_ns);
    if (!table->has("time_period_s")) table->refuse("time_id", "belongs to time_period_s");
    table->read("time_id", can.time_id);
    table->read("redundancy", can.redundancy);
    if (can.redundancy == CanSettings::Redundancy::hot)
        for (const std::string_view key : {"heartbeat_id", "heartbeat_timeout_s"})
            table->refuse(key, "belongs to redundancy = \"cold\", and this is \"hot\"");
    table->read("heartbeat_id", can.heartbeat_id);
    read_seconds("heartbeat_timeout_s", can.heartbeat_timeout_ns);
    table->finish();
}

}  // namespace

constinit const TableKeys kSceneKeys{.rows = kSceneRows}, kSunKeys{.rows = kSunRows},
    kAmbientKeys{.rows = kAmbientRows}, kRenderKeys{.rows = kRenderRows}, kTimeKeys{.rows = kTimeRows},
    kCanKeys{.rows = kCanRows};

void read_surroundings(TableReader& root, SceneReading& reading) {
    const bool has_epoch = reading.has_epoch = read_scene_table(root, reading.scene);
    read_sun(root, reading.scene, has_epoch);
    read_ambient(root, reading.scene);
    read_stars(root, reading, has_epoch ? std::optional(julian_year(reading.scene.epoch_unix_ns)) : std::nullopt);
    read_render(root, reading.scene);
    read_time(root, reading.scene);
    read_can(root, reading.scene);
}

}  // namespace narpa
