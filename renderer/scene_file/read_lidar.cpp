#include <fmt/format.h>

#include <array>

#include "base/constants.h"
#include "base/file_bytes.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/assets/lidar_calibration.h"
#include "renderer/scene_file/lidar_description.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr Range kLength{.low = 0, .high = 1e3};

void read_beam(TableReader& table, LidarReceiverModel& r) {
    r.beam_divergence_rad = table.number("beam_divergence_rad", {.low = 0, .high = 0.1}).value_or(0);
    r.sub_rays = static_cast<int>(
        table.integer("sub_rays", 1, LidarReceiverModel::kMaxSubRays).value_or(r.beam_divergence_rad > 0 ? 32 : 1));
    if (r.sub_rays > 1 && r.sub_rays < LidarReceiverModel::kMinSubRays)
        table.fail("sub_rays", fmt::format("{} is too few, expected 1, or {} to {}", r.sub_rays,
                                           LidarReceiverModel::kMinSubRays, LidarReceiverModel::kMaxSubRays));
    if (r.sub_rays > 1 && r.beam_divergence_rad == 0)
        table.require("beam_divergence_rad", "a number > 0, as sub_rays sample the beam's cone");
    r.pulse_length_m = table.number("pulse_length_m", kLength).value_or(r.pulse_length_m);
    using enum LidarReceiverModel::Multipath;
    static constexpr std::array<std::pair<std::string_view, LidarReceiverModel::Multipath>, 3> kMultipaths{
        {{"none", none}, {"mirrors", mirrors}, {"diffuse", diffuse}}};
    r.multipath = table.choice<LidarReceiverModel::Multipath>("multipath", kMultipaths).value_or(none);
}

void read_detection(TableReader& table, LidarReceiverModel& r) {
    r.range_at_10_percent_m =
        table.number("range_at_10_percent_m", {.low = 0, .high = 1e6, .low_open = true}).value_or(0);
    r.detection_snr = table.number("detection_snr", {.low = 0, .high = 1e3}).value_or(0);
    r.sunlight_noise = table.number("sunlight_noise", {.low = 0, .high = 1e6}).value_or(0);
    r.range_noise_at_limit_m = table.number("range_noise_at_limit_m", kLength).value_or(0);
    r.range_walk_m = table.number("range_walk_m", {.low = -1e3, .high = 1e3}).value_or(0);
    if (r.range_at_10_percent_m == 0)
        for (const char* key : {"detection_snr", "sunlight_noise", "range_noise_at_limit_m", "range_walk_m"})
            table.refuse(key, "counts from the echo that is just detected: there is no range_at_10_percent_m");
}

LidarReceiverModel read_receiver(TableReader& table) {
    LidarReceiverModel r;
    read_beam(table, r);
    read_detection(table, r);
    r.range_bias_m = table.number("range_bias_m", {.low = -1e3, .high = 1e3}).value_or(0);
    r.range_noise_m = table.number("range_noise_m", kLength).value_or(0);
    r.range_ambiguity_m = table.number("range_ambiguity_m", {.low = 0, .high = 1e9, .low_open = true}).value_or(0);
    r.velocity_noise_m_s = table.number("velocity_noise_m_s", kLength).value_or(0);
    r.velocity_ambiguity_m_s =
        table.number("velocity_ambiguity_m_s", {.low = 0, .high = 1e6, .low_open = true}).value_or(0);
    return r;
}

/// A make built into narpa, or one that a file describes.
LidarMake read_make(TableReader& table, const std::filesystem::path& folder) {
    std::vector<std::pair<std::string_view, const LidarMake*>> makes;
    for (const LidarMake* make : lidar_makes()) makes.emplace_back(make->name, make);
    const LidarMake& first = *makes.front().second;
    table.require("model", fmt::format("\"{}\"", first.name));
    const auto name = table.is_text("model") ? table.text("model") : std::nullopt;
    if (!name || !name->ends_with(".toml")) return *table.choice<const LidarMake*>("model", makes).value_or(&first);
    auto described = read_lidar_description((folder / *name).string());
    if (described) return *std::move(described);
    table.fail("model", described.error().text());
    return first;
}

LidarReturns read_returns(TableReader& table, const LidarMake& make) {
    using enum LidarReturns;
    static constexpr std::array<std::pair<std::string_view, LidarReturns>, 3> kReturns{
        {{"strongest", strongest}, {"last", last}, {"dual", dual}}};
    return table.choice<LidarReturns>("returns", std::span(kReturns).first(make.dual ? 3 : 2)).value_or(strongest);
}

LidarPps read_pps(TableReader& table) {
    using enum LidarPps;
    static constexpr std::array<std::pair<std::string_view, LidarPps>, 4> kStates{
        {{"absent", absent}, {"synchronising", synchronising}, {"locked", locked}, {"error", error}}};
    return table.choice<LidarPps>("pps", kStates).value_or(locked);
}

/// Reads packet profile, columns and the maker's calibration file, for makes that have them.
void read_mode(TableReader& table, const LidarMake& make, const std::filesystem::path& folder,
               LidarSettings& settings) {
    if (!table.has("rate_hz")) settings.rate_hz = 0;
    std::vector<std::pair<std::string_view, std::string_view>> profiles;
    for (const std::string_view profile : make.profiles) profiles.emplace_back(profile, profile);
    settings.profile = table.choice<std::string_view>("profile", profiles).value_or("");
    if (const auto columns = table.integer("columns", make.columns.front(), make.columns.back()))
        settings.columns = static_cast<int>(*columns);
    table.refuse("returns", "the profile decides on them");
    std::string file;
    if (const auto name = table.text("calibration")) {
        file = (folder / *name).string();
        auto text = read_file(file);
        if (!text) return table.fail("calibration", text.error().text());
        settings.calibration = *std::move(text);
        if (settings.calibration.empty()) return table.fail("calibration", Error{"is empty", file}.text());
    }
    const Status completed = make.complete(settings);
    if (completed) return;
    Error error = completed.error();
    if (error.line > 0) error.file = file;
    table.fail(error.line > 0 ? "calibration" : table.has("columns") ? "columns" : "rate_hz", error.text());
}

LidarSettings read_settings(TableReader& table, const LidarMake& make, const std::filesystem::path& folder) {
    LidarSettings settings;
    settings.rate_hz =
        table.number("rate_hz", {.low = make.rate_hz_min, .high = make.rate_hz_max}).value_or(make.rate_hz_default);
    settings.pps = read_pps(table);
    if (make.complete) {
        read_mode(table, make, folder, settings);
        return settings;
    }
    settings.returns = read_returns(table, make);
    if (make.beams == 0) table.refuse("calibration", fmt::format("a {} takes none", make.name));
    if (const auto file = table.text("calibration")) {
        auto beams = read_lidar_calibration((folder / *file).string(), make.beams);
        if (beams)
            settings.beams = *std::move(beams);
        else
            table.fail("calibration", beams.error().text());
    }
    return settings;
}

bool lights_an_area(const Lidar& lidar) {
    return lidar.receiver.beam_divergence_rad > 0 || lidar.model->spec().lit.kind != LidarField::Kind::beam;
}

}  // namespace

Lidar read_lidar(TableReader& table, std::vector<std::string>& names, const Scene& scene,
                 const std::filesystem::path& folder) {
    Lidar lidar;
    lidar.name = read_name(table, names);
    const Mounting mounting = read_mounting(table, scene.bodies, lidar_attitude);
    lidar.mount = mounting.mount;
    lidar.T_mount_lidar = mounting.T_mount_sensor;
    const LidarMake make = read_make(table, folder);
    lidar.model = make.configure(read_settings(table, make, folder));
    const double range_m_most = lidar.model->spec().range_m_max;
    lidar.range_max_m = table.number("range_max_m", {.low = 0, .high = range_m_most, .low_open = true})
                            .value_or(make.range_m_default);
    lidar.receiver = read_receiver(table);
    lidar.receiver.range_min_m = table.number("range_min_m", {.low = 0, .high = range_m_most}).value_or(0);
    if (!(lidar.receiver.range_min_m < lidar.range_max_m))
        table.fail("range_min_m", fmt::format("is {:g}, expected less than the largest range, {:g}",
                                              lidar.receiver.range_min_m, lidar.range_max_m));
    if (!lidar.model->spec().measures_velocity)
        for (const char* key : {"velocity_noise_m_s", "velocity_ambiguity_m_s"})
            table.refuse(key, fmt::format("a {} measures no velocity", make.name));
    if (lidar.receiver.multipath == LidarReceiverModel::Multipath::diffuse && !lights_an_area(lidar))
        table.fail("multipath",
                   "\"diffuse\" is of beams that light an area: expected a beam_divergence_rad, or a model whose "
                   "[grid] is a flash");
    table.finish();
    return lidar;
}

}  // namespace narpa
