#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "base/constants.h"
#include "renderer/ephemeris/sun_direction.h"
#include "renderer/scene_file/kind_names.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr double kMaxBudgetMs = 1e6;
constexpr std::int64_t kMaxBudgetRays = 1'000'000'000'000;
constexpr int kFirstYear = 1900, kLastYear = 2100;  // range of ERFA's Earth ephemeris and of int64 nanoseconds

std::int64_t unix_ns_from(const toml::date_time& t) {
    using namespace std::chrono;
    const sys_days day = year(t.date.year) / month(t.date.month) / std::chrono::day(t.date.day);
    const std::int64_t seconds = duration_cast<std::chrono::seconds>(day.time_since_epoch()).count() +
                                 3600 * t.time.hour + 60 * t.time.minute + t.time.second -
                                 (t.offset ? 60 * t.offset->minutes : 0);
    return seconds * 1'000'000'000 + t.time.nanosecond;
}

/// An ISO 8601 text by the rules of TOML's own dates.
std::optional<toml::date_time> parse_date(const std::string& text) {
    if (text.size() > 40 || text.find_first_not_of("0123456789-+:.TtZz ") != std::string::npos) return std::nullopt;
    try {
        const toml::table table = toml::parse(std::string_view("t = " + text), std::string_view());
        if (const auto* t = table["t"].as_date_time()) return t->get();
        if (const auto* d = table["t"].as_date()) return toml::date_time(d->get(), toml::time{});
    } catch (const toml::parse_error&) {
    }
    return std::nullopt;
}

std::optional<toml::date_time> date_of(const toml::node& node) {
    if (const auto* t = node.as_date_time()) return t->get();
    if (const auto* d = node.as_date()) return toml::date_time(d->get(), toml::time{});
    if (const auto* s = node.as_string()) return parse_date(s->get());
    return std::nullopt;
}

double julian_year(std::int64_t unix_ns) {
    constexpr double kJ2000_s = 946'728'000, kYear_s = 365.25 * 86400;  // leap seconds do not matter here
    return 2000 + (1e-9 * static_cast<double>(unix_ns) - kJ2000_s) / kYear_s;
}

/// UTC; a time without an offset is UTC. False when the scene has none.
bool read_epoch(TableReader& table, Scene& scene) {
    const toml::node* node = table.find("epoch");
    if (!node) return false;
    const std::optional<toml::date_time> t = date_of(*node);
    if (t && t->date.year >= kFirstYear && t->date.year < kLastYear) {
        scene.epoch_unix_ns = unix_ns_from(*t);
    } else {
        table.fail("epoch",
                   fmt::format("expected a UTC date and time of the years {} to {}, as 2026-03-01T12:00:00Z",
                               kFirstYear, kLastYear - 1));
    }
    return true;
}

bool read_scene_table(TableReader& root, Scene& scene) {
    scene.name = std::filesystem::path(scene.file).stem().string();
    auto table = root.table("scene");
    if (!table) return false;
    (void)table->has("based_on");
    scene.name = table->text("name").value_or(scene.name);
    const bool has_epoch = read_epoch(*table, scene);
    table->finish();
    return has_epoch;
}

void read_sun(TableReader& root, Scene& scene, bool has_epoch) {
    auto table = root.table("sun");
    if (!table) return;
    Sun sun;
    sun.irradiance_w_m2 = table->number("irradiance_w_m2", kPositive).value_or(sun.irradiance_w_m2);
    if (const auto d = table->number("angular_diameter_deg", {.low = 0, .high = 180, .high_open = true}))
        sun.angular_diameter_rad = *d * kPi / 180.0;
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
    table->require("radiance", "a number or [r, g, b], W m^-2 sr^-1");
    scene.ambient = table->rgb("radiance", {.low = 0, .high = 1e30}).value_or(Rgb{});
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
    render.spp = static_cast<int>(table.integer("spp", 1, 65535).value_or(render.spp));
    if (const auto ms = table.number("budget_ms", {.low = 0.001, .high = kMaxBudgetMs}))
        render.budget_ns = std::llround(*ms * 1e6);
    if (const auto rays = table.integer("budget_rays", 1, kMaxBudgetRays))
        render.budget_rays = static_cast<std::uint64_t>(*rays);
}

void read_render(TableReader& root, Scene& scene) {
    auto table = root.table("render");
    if (!table) return;
    RenderSettings& render = scene.render;
    render.method = table->choice<RenderSettings::Method>("method", kMethods).value_or(render.method);
    if (render.method == RenderSettings::Method::direct)
        table->refuse("max_depth", "belongs to method = \"path\", and this is \"direct\"");
    render.max_depth = static_cast<int>(table->integer("max_depth", 1, 40).value_or(render.max_depth));
    read_budget(*table, render);
    render.seed = static_cast<std::uint64_t>(table->integer("seed", 0, INT64_MAX).value_or(0));
    render.stale_after_s = table->number("stale_after_s", kPositive).value_or(render.stale_after_s);
    // Time stamps on the bus are unambiguous within 39 h.
    render.command_ahead_max_s =
        table->number("command_ahead_max_s", {.low = 0.001, .high = 140'000}).value_or(render.command_ahead_max_s);
    table->finish();
}

}  // namespace

void read_surroundings(TableReader& root, SceneReading& reading) {
    const bool has_epoch = reading.has_epoch = read_scene_table(root, reading.scene);
    read_sun(root, reading.scene, has_epoch);
    read_ambient(root, reading.scene);
    read_stars(root, reading, has_epoch ? std::optional(julian_year(reading.scene.epoch_unix_ns)) : std::nullopt);
    read_render(root, reading.scene);
}

}  // namespace narpa
