#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

std::int64_t read_period_ns(TableReader& table, std::int64_t otherwise) {
    const auto rate_hz = table.number("rate_hz", {.low = 1e-3, .high = 10000});
    return rate_hz ? std::llround(1e9 / *rate_hz) : otherwise;
}

PixelFormat read_format(TableReader& table, const Camera& camera) {
    std::array<std::pair<std::string_view, PixelFormat>, kPixelFormatNames.size()> formats;
    for (std::size_t i = 0; i < formats.size(); ++i)
        formats[i] = {kPixelFormatNames[i], static_cast<PixelFormat>(i)};
    const PixelFormat format = table.choice<PixelFormat>("format", formats).value_or(PixelFormat::grey);
    if (const std::string what = unfit_size(format, camera.width, camera.height); !what.empty())
        table.fail("format", what);
    return format;
}

LatePolicy read_late_policy(TableReader& table) {
    using enum LatePolicy;
    static constexpr std::array<std::pair<std::string_view, LatePolicy>, 4> kPolicies{
        {{"drop", drop}, {"repeat", repeat}, {"late", late}, {"blank", blank}}};
    return table.choice<LatePolicy>("late_policy", kPolicies).value_or(late);
}

/// A share of the pixels and the current of each, which belong together.
void read_defects(TableReader& table, const char* share_key, const char* current_key, double& share,
                  double& current_e_s) {
    share = table.number(share_key, {.low = 0, .high = 0.1}).value_or(0);
    if (share > 0) table.require(current_key, "a number > 0, as there is such a share of pixels");
    if (!table.has(share_key)) table.refuse(current_key, fmt::format("there is no {}", share_key));
    current_e_s = table.number(current_key, kPositive).value_or(0);
}

/// Dark current, and what makes pixels differ from each other.
void read_sensor_array(TableReader& table, Detector& d) {
    const Range celsius{.low = -273.15, .high = 200};
    d.dark_current_e_s = table.number("dark_current_e_s", kNotNegative).value_or(0);
    d.dark_reference_c = table.number("dark_reference_c", celsius).value_or(d.dark_reference_c);
    d.temperature_c = table.number("temperature_c", celsius).value_or(d.dark_reference_c);
    d.dark_doubling_c = table.number("dark_doubling_c", {.low = 1, .high = 100}).value_or(d.dark_doubling_c);
    d.prnu = table.number("prnu", {.low = 0, .high = 0.5}).value_or(0);
    d.dsnu_e = table.number("dsnu_e", kNotNegative).value_or(0);
    d.dead_pixel_share = table.number("dead_pixel_share", {.low = 0, .high = 0.1}).value_or(0);
    read_defects(table, "hot_pixel_share", "hot_pixel_e_s", d.hot_pixel_share, d.hot_pixel_e_s);
    read_defects(table, "blinking_pixel_share", "blinking_e_s", d.blinking_pixel_share, d.blinking_e_s);
    d.blooming = table.boolean("blooming").value_or(false);
    d.cosmic_rays_per_cm2_s = table.number("cosmic_rays_per_cm2_s", {.low = 0, .high = 1e6}).value_or(0);
    d.sensitive_depth_m =
        table.number("sensitive_depth_m", {.low = 0, .high = 0.01, .low_open = true}).value_or(d.sensitive_depth_m);
}

std::optional<Detector> read_detector(TableReader& camera, std::int64_t period_ns) {
    auto table = camera.table("detector");
    if (!table) return std::nullopt;
    Detector d;
    d.exposure_s = table->number("exposure_s", kPositive).value_or(d.exposure_s);
    d.pixel_pitch_m = table->number("pixel_pitch_m", kPositive).value_or(d.pixel_pitch_m);
    d.f_number = table->number("f_number", kPositive).value_or(d.f_number);
    d.quantum_efficiency =
        table->number("quantum_efficiency", {.low = 0, .high = 1, .low_open = true}).value_or(d.quantum_efficiency);
    d.full_well_e = table->number("full_well_e", {.low = 1}).value_or(d.full_well_e);
    d.gain_e_per_dn = table->number("gain_e_per_dn", kNotNegative).value_or(d.gain_e_per_dn);
    d.read_noise_e = table->number("read_noise_e", kNotNegative).value_or(d.read_noise_e);
    d.shot_noise = table->boolean("shot_noise").value_or(d.shot_noise);
    d.bits = static_cast<int>(table->integer("bits", 8, 16).value_or(d.bits));
    d.black_level_dn = static_cast<int>(table->integer("black_level_dn", 0, (1 << d.bits) - 2).value_or(0));
    read_sensor_array(*table, d);
    d.exposure_s *= std::exp2(table->number("exposure_stops", {.low = -20, .high = 20}).value_or(0));
    const double period_s = 1e-9 * static_cast<double>(period_ns);
    if (d.exposure_s > period_s) {
        const std::string what = fmt::format("{} s is longer than a frame, expected at most 1 / rate_hz = {:g} s",
                                             d.exposure_s, period_s);
        table->fail("exposure_s", what);
    }
    table->finish();
    return d;
}

/// From the start of the first row's exposure to that of the last one's.
double rows_s(const Camera& c, const std::optional<Shutter>& shutter) {
    return shutter ? 1e-9 * static_cast<double>(shutter->row_time_ns) * (c.height - 1) : 0;
}

/// A shutter needs an exposure time, which the detector states.
std::optional<Shutter> read_shutter(TableReader& camera, const Camera& c) {
    enum class Kind : std::uint8_t { global, rolling };
    static constexpr std::array<std::pair<std::string_view, Kind>, 2> kKinds{
        {{"global", Kind::global}, {"rolling", Kind::rolling}}};
    auto table = camera.table("shutter");
    if (!table) return std::nullopt;
    table->require("kind", "\"global\" or \"rolling\"");
    const Kind kind = table->choice<Kind>("kind", kKinds).value_or(Kind::global);
    Shutter shutter;
    const auto row_time_s = table->number("row_time_s", kPositive);
    if (kind == Kind::rolling) table->require("row_time_s", "the time from one row's start to the next one's");
    if (kind == Kind::global) table->refuse("row_time_s", "belongs to kind = \"rolling\"");
    if (row_time_s) shutter.row_time_ns = std::llround(std::min(*row_time_s, 1e3) * 1e9);
    if (!c.detector) table->fail("kind", "needs an exposure_s, expected a [camera.detector]");
    const double image_s = (c.detector ? c.detector->exposure_s : 0) + rows_s(c, shutter);
    if (image_s >= 1e-9 * static_cast<double>(c.period_ns))
        table->fail("row_time_s",
                    fmt::format("exposure and rows take {:g} s, expected less than 1 / rate_hz = {:g} s", image_s,
                                1e-9 * static_cast<double>(c.period_ns)));
    table->finish();
    return shutter;
}

std::optional<CameraControlLimits> read_control(TableReader& camera, const Camera& c) {
    static constexpr std::array<std::pair<std::string_view, TriggerMode>, 3> kModes{
        {{kTriggerModes[0], TriggerMode::free_running},
         {kTriggerModes[1], TriggerMode::command},
         {kTriggerModes[2], TriggerMode::sync}}};
    auto table = camera.table("control");
    if (!table) return std::nullopt;
    if (!c.detector) {
        table->fail("latency_s", "needs an exposure_s, expected a [camera.detector]");
        return std::nullopt;
    }
    const double period_s = 1e-9 * static_cast<double>(c.period_ns);
    CameraControlLimits control;
    const auto ns = [&](std::string_view key, const Range& range, double otherwise_s) {
        return static_cast<std::int64_t>(std::llround(table->number(key, range).value_or(otherwise_s) * 1e9));
    };
    const double exposure_s = c.detector->exposure_s;
    // At least a millisecond: the bus thread may be that late.
    control.latency_ns = ns("latency_s", {.low = 1e-3, .high = 10}, 0.01);
    control.trigger = table->choice<TriggerMode>("trigger", kModes).value_or(control.trigger);
    control.exposure_min_ns = ns("exposure_min_s", {.low = 1e-9, .high = exposure_s}, std::min(1e-5, exposure_s));
    control.exposure_max_ns = ns("exposure_max_s", {.low = exposure_s, .high = 100},
                                 std::max(exposure_s, 0.9 * (period_s - rows_s(c, c.shutter))));
    control.gain_max_cdb =
        static_cast<std::int16_t>(100 * table->number("gain_max_db", {.low = 0, .high = 60}).value_or(24));
    control.auto_exposure = table->boolean("auto_exposure").value_or(false);
    control.level = table->number("auto_exposure_level", {.low = 0.01, .high = 0.9}).value_or(control.level);
    table->finish();
    return control;
}

/// The radiance that an ideal sensor maps to full scale: that of a white Lambert surface that faces the Sun or,
/// without a Sun, of the brightest band of the ambient light. 0 if there is neither.
double white_radiance(const Scene& scene) {
    if (scene.sun) return scene.sun->irradiance_w_m2 / kPi;
    return std::max({scene.ambient.x, scene.ambient.y, scene.ambient.z});
}

/// Refuses keys of the detector in [[camera]], a likely mistake.
void refuse_keys_of_detector(TableReader& camera) {
    for (const char* key :
         {"exposure_s", "exposure_stops", "pixel_pitch_m", "f_number", "quantum_efficiency", "full_well_e",
          "gain_e_per_dn", "read_noise_e", "shot_noise", "bits", "black_level_dn", "dark_current_e_s"})
        camera.refuse(key, "belongs to the camera's detector, expected it in [camera.detector]");
}

/// Refuses tables of a camera at the top level.
void refuse_tables_of_camera(TableReader& root) {
    for (const char* key :
         {"detector", "shutter", "control", "intrinsics", "distortion", "lens", "psf", "vignetting", "ghost"})
        root.refuse(key, fmt::format("belongs to a camera, expected [camera.{}] after its [[camera]]", key));
}

/// Refuses thin lenses with a wide field: rays at right angles to the axis do not meet the plane of focus.
void refuse_wide_field(TableReader& table, const Camera& camera) {
    constexpr double kWidest_deg = 80;
    const DirectionCone field = camera.model->bounds({-0.5, -0.5, camera.width - 0.5, camera.height - 0.5});
    const double off_axis_deg = (std::acos(std::clamp(field.axis.z, -1.0, 1.0)) + field.half_angle_rad) * 180 / kPi;
    if (off_axis_deg > kWidest_deg)
        table.fail("lens", fmt::format("the image reaches {:.0f} degrees off the axis, expected at most {:g} for a "
                                       "thin lens",
                                       off_axis_deg, kWidest_deg));
}

Camera read_camera(TableReader& table, std::vector<std::string>& names, const SceneReading& reading) {
    const Scene& scene = reading.scene;
    const std::filesystem::path& folder = reading.folder;
    Camera camera;
    camera.name = read_name(table, names);
    const Mounting mounting = read_mounting(table, scene.bodies, camera_attitude);
    camera.mount = mounting.mount;
    camera.T_mount_camera = mounting.T_mount_sensor;
    read_tracking(table, reading, camera);
    read_projection(table, camera, folder);
    camera.period_ns = read_period_ns(table, camera.period_ns);
    if (scene.render.budget_ns > camera.period_ns)
        table.fail("rate_hz", fmt::format("a period of {} ms, expected at least the budget_ms of [render], {}",
                                          static_cast<double>(camera.period_ns) * 1e-6,
                                          static_cast<double>(scene.render.budget_ns) * 1e-6));
    camera.format = read_format(table, camera);
    camera.embedded_line = table.boolean("embedded_line").value_or(camera.embedded_line);
    if (camera.embedded_line && camera.height < 2)
        table.fail("embedded_line", "takes the last row, expected a resolution of at least 2 rows");
    camera.late = read_late_policy(table);
    camera.detector = read_detector(table, camera.period_ns);
    camera.shutter = read_shutter(table, camera);
    camera.control = read_control(table, camera);
    read_optics(table, camera, scene.sun.has_value(), folder);
    if (camera.lens) refuse_wide_field(table, camera);
    camera.white_radiance = table.number("white_radiance", kPositive).value_or(white_radiance(scene));
    refuse_keys_of_detector(table);
    if (camera.detector) table.refuse("white_radiance", "belongs to cameras without a [camera.detector]");
    if (!camera.detector && !(camera.white_radiance > 0))
        table.require("white_radiance", "a number > 0, as there is neither [sun] nor [ambient] to take it from");
    table.finish();
    return camera;
}

}  // namespace

void read_sensors(TableReader& root, SceneReading& reading) {
    Scene& scene = reading.scene;
    std::vector<std::string> cameras, lidars;
    for (TableReader& table : root.tables("camera")) scene.cameras.push_back(read_camera(table, cameras, reading));
    for (TableReader& table : root.tables("lidar"))
        scene.lidars.push_back(read_lidar(table, lidars, scene, reading.folder));
    refuse_tables_of_camera(root);
    if (!root.has("camera") && !root.has("lidar")) root.require("camera", "at least one [[camera]] or [[lidar]]");
}

}  // namespace narpa
