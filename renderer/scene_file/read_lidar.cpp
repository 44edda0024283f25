#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/constants.h"
#include "base/file_bytes.h"
#include "base/time.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/assets/lidar_calibration.h"
#include "renderer/scene_file/lidar_description.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr Range kLength{.low = 0, .high = 1e3};

using Multipath = LidarReceiverModel::Multipath;
constexpr std::array<std::string_view, 3> kMultipathNames{"none", "mirrors", "diffuse"};
constexpr std::array<std::string_view, 4> kPpsNames{"absent", "synchronising", "locked", "error"};
constexpr std::array<std::pair<std::string_view, LidarReturns>, 3> kReturns{
    {{"strongest", LidarReturns::strongest}, {"last", LidarReturns::last}, {"dual", LidarReturns::dual}}};

std::vector<std::string_view> make_names() {
    std::vector<std::string_view> names;
    for (const LidarMake* make : lidar_makes()) names.push_back(make->name);
    return names;
}

std::vector<std::string_view> profile_names() {
    std::vector<std::string_view> names;
    for (const LidarMake* make : lidar_makes())
        for (const std::string_view profile : make->profiles)
            if (std::ranges::find(names, profile) == names.end()) names.push_back(profile);
    return names;
}

/// Makes narrow the ranges of `rate_hz`, `columns`, `range_min_m` and `range_max_m`.
constexpr TableKey kLidarRows[]{
    {"model", rows::or_file(rows::choice(make_names)), "\"VLP-16\""},
    {"rate_hz", rows::number({.low = 0, .high = 1e4, .low_open = true})},
    {"pps", rows::choice<kPpsNames>()},
    {"returns", rows::choice<kReturns>()},
    {"profile", rows::choice(profile_names)},
    {"columns", rows::integer(1, 65536)},
    {"calibration", rows::file()},
    {"range_max_m", rows::number(kPositive)},
    {"range_min_m", rows::number(kNotNegative)},
    {"beam_divergence_rad", rows::number({.low = 0, .high = 0.1})},
    {"sub_rays", rows::integer(1, LidarReceiverModel::kMaxSubRays)},
    {"pulse_length_m", rows::number(kLength)},
    {"multipath", rows::choice<kMultipathNames>()},
    {"range_at_10_percent_m", rows::number({.low = 0, .high = 1e6, .low_open = true})},
    {"detection_snr", rows::number(kLength)},
    {"sunlight_noise", rows::number({.low = 0, .high = 1e6})},
    {"range_noise_at_limit_m", rows::number(kLength)},
    {"range_walk_m", rows::number({.low = -1e3, .high = 1e3})},
    {"range_bias_m", rows::number({.low = -1e3, .high = 1e3})},
    {"range_noise_m", rows::number(kLength)},
    {"range_ambiguity_m", rows::number({.low = 0, .high = 1e9, .low_open = true})},
    {"velocity_noise_m_s", rows::number(kLength)},
    {"velocity_ambiguity_m_s", rows::number({.low = 0, .high = 1e6, .low_open = true})},
};

void read_beam(TableReader& table, LidarReceiverModel& r) {
    table.read("beam_divergence_rad", r.beam_divergence_rad);
    r.sub_rays = static_cast<int>(table.integer("sub_rays").value_or(r.beam_divergence_rad > 0 ? 32 : 1));
    if (r.sub_rays > 1 && r.sub_rays < LidarReceiverModel::kMinSubRays)
        table.fail("sub_rays", fmt::format("{} is too few, expected 1, or {} to {}", r.sub_rays,
                                           LidarReceiverModel::kMinSubRays, LidarReceiverModel::kMaxSubRays));
    if (r.sub_rays > 1 && r.beam_divergence_rad == 0)
        table.require("beam_divergence_rad", "a number > 0, as sub_rays sample the beam's cone");
    table.read("pulse_length_m", r.pulse_length_m);
    table.read("multipath", r.multipath);
}

void read_detection(TableReader& table, LidarReceiverModel& r) {
    table.read("range_at_10_percent_m", r.range_at_10_percent_m);
    table.read("detection_snr", r.detection_snr);
    table.read("sunlight_noise", r.sunlight_noise);
    table.read("range_noise_at_limit_m", r.range_noise_at_limit_m);
    table.read("range_walk_m", r.range_walk_m);
    if (r.range_at_10_percent_m == 0)
        for (const char* key : {"detection_snr", "sunlight_noise", "range_noise_at_limit_m", "range_walk_m"})
            table.refuse(key, "counts from the echo that is just detected: there is no range_at_10_percent_m");
}

LidarReceiverModel read_receiver(TableReader& table) {
    LidarReceiverModel r;
    read_beam(table, r);
    read_detection(table, r);
    table.read("range_bias_m", r.range_bias_m);
    table.read("range_noise_m", r.range_noise_m);
    table.read("range_ambiguity_m", r.range_ambiguity_m);
    table.read("velocity_noise_m_s", r.velocity_noise_m_s);
    table.read("velocity_ambiguity_m_s", r.velocity_ambiguity_m_s);
    return r;
}

/// A make built into narpa, or one that a file describes.
LidarMake read_make(TableReader& table, const std::filesystem::path& folder) {
    const auto makes = lidar_makes();
    const LidarMake& first = *makes.front();
    const auto name = table.is_text("model") ? table.text("model") : std::nullopt;
    if (!name || !name->ends_with(".toml")) return *makes[table.word("model").value_or(0)];
    auto described = read_lidar_description((folder / *name).string());
    if (described) return *std::move(described);
    table.fail("model", described.error().text());
    return first;
}

LidarReturns read_returns(TableReader& table, const LidarMake& make) {
    const std::span all(kReturns);
    return table.choice<LidarReturns>("returns", all.first(make.dual ? 3 : 2)).value_or(LidarReturns::strongest);
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

LidarSettings read_settings(TableReader& table, const LidarMake& make, const std::filesystem::path& folder,
                            std::vector<std::string>& warnings) {
    LidarSettings settings;
    settings.rate_hz =
        table.number("rate_hz", {.low = make.rate_hz_min, .high = make.rate_hz_max}).value_or(make.rate_hz_default);
    table.read("pps", settings.pps);
    if (make.complete) {
        read_mode(table, make, folder, settings);
        return settings;
    }
    settings.returns = read_returns(table, make);
    if (make.beams == 0) table.refuse("calibration", fmt::format("a {} takes none", make.name));
    if (const auto file = table.text("calibration")) {
        auto beams = read_lidar_calibration((folder / *file).string(), make.beams, &warnings);
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

constinit const TableKeys kLidarKeys{.rows = kLidarRows, .parts = {&kMountingKeys}};

Lidar read_lidar(TableReader& table, TakenNames& names, Scene& scene, const std::filesystem::path& folder) {
    Lidar lidar;
    lidar.name = read_name(table, names);
    const Mounting mounting = read_mounting(table, scene.bodies, lidar_attitude);
    lidar.mount = mounting.mount;
    lidar.T_mount_lidar = mounting.T_mount_sensor;
    // Up to where 32 bits of seconds since 1970 reach.
    if (scene.epoch_unix_ns < 0 || scene.epoch_unix_ns / kSecond_ns > UINT32_MAX)
        table.fail("model",
                   "packets and captures are stamped in time since 1970: expected an epoch in [scene] of "
                   "1970 to 2105");
    const LidarMake make = read_make(table, folder);
    LidarSettings settings = read_settings(table, make, folder, scene.warnings);
    settings.ptp = scene.time.source == TimeSettings::Source::system;
    lidar.model = make.configure(settings);
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
    if (lidar.receiver.multipath == Multipath::diffuse && !lights_an_area(lidar))
        table.fail("multipath",
                   "\"diffuse\" is of beams that light an area: expected a beam_divergence_rad, or a model whose "
                   "[grid] is a flash");
    table.finish();
    return lidar;
}

}  // namespace narpa
