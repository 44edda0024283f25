#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "protocols/video/embedded_line.h"
#include "renderer/assets/images/point_spread_file.h"
#include "renderer/detector/detector_stage.h"
#include "renderer/optics/optical_effect.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr TableKey kShutterRows[]{{"kind", rows::kind(), "\"global\" or \"rolling\""}};
constexpr TableKey kRollingRows[]{
    {"row_time_s", rows::number(kPositive), "the time from one row's start to the next one's"}};
constexpr Range kExposure{.low = 1e-9, .high = 100};
constexpr TableKey kControlRows[]{
    // At least a millisecond: the bus thread may be that late.
    {"latency_s", rows::number({.low = 1e-3, .high = 10})},
    {"trigger", rows::choice<kTriggerModes>()},
    {"exposure_min_s", rows::number(kExposure)},  // the detector's exposure_s narrows both
    {"exposure_max_s", rows::number(kExposure)},
    {"gain_max_db", rows::number({.low = 0, .high = 60})},
    {"auto_exposure", rows::boolean()},
    {"auto_exposure_level", rows::number({.low = 0.01, .high = 0.9})},
};
constexpr TableKeys kControlKeys{.rows = kControlRows};
constexpr TableKeys kShutterKeys{.rows = kShutterRows, .kinds = [] {
                                     return std::vector<TableKind>{{"global"}, {"rolling", kRollingRows}};
                                 }};
constexpr std::array<std::string_view, 4> kLatePolicyNames{"drop", "repeat", "late", "blank"};
constexpr std::array<std::string_view, 2> kByteOrders{"little", "big"};
constexpr TableKey kCameraRows[]{
    {"format", rows::choice<kCameraFormatNames>()},
    {"byte_order", rows::choice<kByteOrders>()},
    {"row_bytes", rows::integer(1, kLinkRowBytesMost)},
    {"rate_hz", rows::number({.low = 1e-3, .high = 10000})},
    {"embedded_line", rows::boolean()},
    {"test_pattern", rows::choice<kTestPatterns>()},
    {"late_policy", rows::choice<kLatePolicyNames>()},
    {"white_radiance", rows::number(kPositive)},
    {"detector", rows::table(kDetectorKeys)},
    {"shutter", rows::table(kShutterKeys)},
    {"control", rows::table(kControlKeys)},
};

/// From the start of the first row's exposure to that of the last one's.
double rows_s(const Camera& c, const std::optional<Shutter>& shutter) {
    return shutter ? 1e-9 * static_cast<double>(shutter->row_time_ns) * (c.height - 1) : 0;
}

/// A shutter needs an exposure time, which the detector states.
std::optional<Shutter> read_shutter(TableReader& camera, const Camera& c) {
    auto table = camera.table("shutter");
    if (!table) return std::nullopt;
    table->kind();
    Shutter shutter;
    const auto row_time_s = table->number("row_time_s");
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
    auto table = camera.table("control");
    if (!table) return std::nullopt;
    if (!c.detector) {
        table->fail("latency_s", "needs an exposure_s, expected a [camera.detector]");
        return std::nullopt;
    }
    const double period_s = 1e-9 * static_cast<double>(c.period_ns);
    CameraControlLimits control;
    const auto ns = [](const std::optional<double>& s, double otherwise_s) {
        return static_cast<std::int64_t>(std::llround(s.value_or(otherwise_s) * 1e9));
    };
    const double exposure_s = c.detector->exposure_s;
    control.latency_ns = ns(table->number("latency_s"), 0.01);
    table->read("trigger", control.trigger);
    control.exposure_min_ns =
        ns(table->number("exposure_min_s", {.low = kExposure.low, .high = exposure_s}), std::min(1e-5, exposure_s));
    control.exposure_max_ns = ns(table->number("exposure_max_s", {.low = exposure_s, .high = kExposure.high}),
                                 std::max(exposure_s, 0.9 * (period_s - rows_s(c, c.shutter))));
    control.gain_max_cdb = static_cast<std::int16_t>(100 * table->number("gain_max_db").value_or(24));
    table->read("auto_exposure", control.auto_exposure);
    table->read("auto_exposure_level", control.level);
    table->finish();
    return control;
}

/// One name says what the samples are and how links lay them out; byte order and padding are keys of their own.
void read_format(TableReader& table, Camera& camera) {
    const auto check = [&](const char* key) {
        const std::string what = unfit_layout(camera.format, camera.link, camera.width);
        if (!what.empty()) table.fail(key, what);
    };
    if (const std::optional<std::size_t> index = table.word("format")) {
        if (*index < kPixelFormats.size()) {
            camera.format = kPixelFormats[*index].format;
        } else {
            const LinkFormatRow& row = kLinkFormats[*index - kPixelFormats.size()];
            camera.format = row.samples;
            camera.link = row.layout;
        }
        check("format");
    }
    camera.link.big_endian = table.word("byte_order") == 1;
    if (camera.link.big_endian) check("byte_order");
    if (const auto bytes = table.integer("row_bytes")) {
        camera.link.row_bytes = static_cast<std::uint32_t>(*bytes);
        check("row_bytes");
        const std::size_t pixels =
            link_pixel_bytes(static_cast<std::size_t>(camera.width), camera.format, camera.link);
        if (camera.link.row_bytes == pixels) camera.link.row_bytes = 0;
    }
}
/// The link's pixels are the ADC's values.
void check_bits_of_link(TableReader& table, Camera& camera) {
    if (camera.embedded_line && !camera.link.is_samples()) camera.link.first_bytes_kept = kEmbeddedLineBytes;
    if (camera.link.kind == LinkLayout::Kind::samples) return;
    if (!camera.detector || camera.detector->bits != camera.link.bits)
        table.fail("format",
                   fmt::format("{} has pixels of {} bits, expected a [camera.detector] with bits = {}",
                               link_name(camera.format, camera.link), camera.link.bits, camera.link.bits));
}

/// The radiance that an ideal sensor maps to full scale: that of a white Lambert surface that faces the Sun or,
/// without a Sun, of the brightest band of the ambient light. 0 if there is neither.
double white_radiance(const Scene& scene) {
    if (scene.sun) return scene.sun->irradiance_w_m2 / kPi;
    return std::max({scene.ambient.x, scene.ambient.y, scene.ambient.z});
}

/// Refuses keys of the detector in [[camera]], a likely mistake.
void refuse_keys_of_detector(TableReader& camera) {
    for (const TableKey* key : kDetectorKeys.all_rows())
        camera.refuse(key->name, "belongs to the camera's detector, expected it in [camera.detector]");
}

/// Refuses tables of a camera at the top level.
void refuse_tables_of_camera(TableReader& root) {
    for (const TableKey* key : kCameraKeys.all_rows())
        if (key->value.type == KeyValue::Type::table)
            root.refuse(key->name,
                        fmt::format("belongs to a camera, expected [camera.{}] after its [[camera]]", key->name));
}

Camera read_camera(TableReader& table, TakenNames& names, SceneReading& reading) {
    const Scene& scene = reading.scene;
    const std::filesystem::path& folder = reading.folder;
    Camera camera;
    camera.name = read_name(table, names);
    const Mounting mounting = read_mounting(table, scene.bodies, camera_attitude);
    camera.mount = mounting.mount;
    camera.T_mount_camera = mounting.T_mount_sensor;
    read_tracking(table, reading, camera);
    read_projection(table, camera, folder, reading.scene.warnings);
    if (const auto rate_hz = table.number("rate_hz")) camera.period_ns = std::llround(1e9 / *rate_hz);
    if (scene.render.budget_ns > camera.period_ns)
        table.fail("rate_hz", fmt::format("a period of {} ms, expected at least the budget_ms of [render], {}",
                                          static_cast<double>(camera.period_ns) * 1e-6,
                                          static_cast<double>(scene.render.budget_ns) * 1e-6));
    read_format(table, camera);
    if (const std::string what = unfit_size(camera.format, camera.width, camera.height); !what.empty())
        table.fail("format", what);
    table.read("embedded_line", camera.embedded_line);
    table.read("test_pattern", camera.test_pattern);
    if (camera.embedded_line && camera.height < 2)
        table.fail("embedded_line", "takes the last row, expected a resolution of at least 2 rows");
    table.read("late_policy", camera.late);
    camera.detector = read_detector(table, camera.period_ns);
    check_bits_of_link(table, camera);
    camera.shutter = read_shutter(table, camera);
    camera.control = read_control(table, camera);
    const auto read_image = [&](TableReader& optics, const std::string& key) -> std::shared_ptr<PointSpreadImage> {
        auto image = read_point_spread_image((folder / *optics.text(key)).string(), &reading.scene.warnings);
        if (image) return *image;
        optics.fail(key, image.error().text());
        return nullptr;
    };
    camera.optics = read_optics(table, {.plane = camera.plane(),
                                        .detector = camera.detector ? &*camera.detector : nullptr,
                                        .has_sun = scene.sun.has_value(),
                                        .read_image = read_image});
    camera.white_radiance = table.number("white_radiance").value_or(white_radiance(scene));
    refuse_keys_of_detector(table);
    if (camera.detector) table.refuse("white_radiance", "belongs to cameras without a [camera.detector]");
    if (!camera.detector && !(camera.white_radiance > 0))
        table.require("white_radiance", "a number > 0, as there is neither [sun] nor [ambient] to take it from");
    table.finish();
    return camera;
}

}  // namespace

constinit const TableKeys kCameraKeys{.rows = kCameraRows,
                                      .parts = {&kMountingKeys, &kTrackingKeys, &kProjectionKeys, &kOpticsKeys}};

void read_sensors(TableReader& root, SceneReading& reading) {
    Scene& scene = reading.scene;
    TakenNames cameras, lidars;
    for (TableReader& table : root.tables("camera")) scene.cameras.push_back(read_camera(table, cameras, reading));
    for (TableReader& table : root.tables("lidar"))
        scene.lidars.push_back(read_lidar(table, lidars, scene, reading.folder));
    refuse_tables_of_camera(root);
    if (!root.has("camera") && !root.has("lidar")) root.require("camera", "at least one [[camera]] or [[lidar]]");
}

}  // namespace narpa
