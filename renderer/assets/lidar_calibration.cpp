#include "renderer/assets/lidar_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "renderer/assets/yaml_file.h"

namespace narpa {
namespace {

double number(const YAML::Node& laser, const char* key, double most) {
    const YAML::Node node = laser[key];
    if (!node) return 0;
    double x = 0;
    if (!YAML::convert<double>::decode(node, x) || !(std::abs(x) <= most))
        throw YamlFault{fmt::format("{}: expected a number in [{}, {}]", key, -most, most), node.Mark()};
    return x;
}

constexpr std::array<std::string_view, 3> kLaserFileKeys{"lasers", "num_lasers", "distance_resolution"};
constexpr std::array<std::string_view, 6> kUsedLaserKeys{
    "laser_id",        "rot_correction",         "vert_correction",
    "dist_correction", "vert_offset_correction", "horiz_offset_correction"};
/// Of a laser, with the value that has no effect: corrections of range and intensity that are not modelled.
constexpr std::array<std::pair<const char*, double>, 7> kUnusedLaserKeys{{{"two_pt_correction_available", 0},
                                                                          {"dist_correction_x", 0},
                                                                          {"dist_correction_y", 0},
                                                                          {"focal_distance", 0},
                                                                          {"focal_slope", 0},
                                                                          {"min_intensity", 0},
                                                                          {"max_intensity", 255}}};

void warn_of_laser(const YAML::Node& laser, std::vector<std::string>& warnings) {
    std::vector<std::string_view> known(kUsedLaserKeys.begin(), kUsedLaserKeys.end());
    for (const auto& [key, neutral] : kUnusedLaserKeys) {
        known.emplace_back(key);
        const YAML::Node node = laser[key];
        bool flag = false;
        double x = neutral;
        if (node && YAML::convert<bool>::decode(node, flag))
            x = flag ? 1 : 0;
        else if (node)
            x = node.as<double>(neutral + 1);
        if (x != neutral) warnings.push_back(fmt::format("\"{}\" of its lasers is not used", key));
    }
    warn_of_keys(laser, known, warnings);
}

void warn_of_file(const YAML::Node& document, std::size_t beams, std::vector<std::string>& warnings) {
    warn_of_keys(document, kLaserFileKeys, warnings);
    if (const YAML::Node node = document["num_lasers"]; node && node.as<std::size_t>(0) != beams)
        throw YamlFault{fmt::format("num_lasers: expected {}", beams), node.Mark()};
    constexpr double kResolution_m = 0.002;
    if (const YAML::Node node = document["distance_resolution"]; node && node.as<double>(0) != kResolution_m)
        warnings.push_back(
            fmt::format("its distance_resolution is not used: packets have multiples of {} m", kResolution_m));
    for (const YAML::Node& laser : document["lasers"])
        if (laser.IsMap()) warn_of_laser(laser, warnings);
    std::ranges::sort(warnings);
    warnings.erase(std::unique(warnings.begin(), warnings.end()), warnings.end());
}

LidarBeam read_beam(const YAML::Node& laser) {
    constexpr double kMax_m = 10, kMax_rad = 3.2;
    if (number(laser, "horiz_offset_correction", kMax_m) != 0)
        throw YamlFault{"horiz_offset_correction: expected 0, as beams start on the axis", laser.Mark()};
    return {.elevation_rad = number(laser, "vert_correction", kMax_rad / 2),
            .azimuth_rad = -number(laser, "rot_correction", kMax_rad),
            .range_offset_m = number(laser, "dist_correction", kMax_m),
            .height_m = number(laser, "vert_offset_correction", kMax_m)};
}

}  // namespace

Result<std::vector<LidarBeam>> read_lidar_calibration(const std::string& file, std::size_t beams,
                                                      std::vector<std::string>* warnings) {
    return read_yaml<std::vector<LidarBeam>>(
        file, "a LiDAR's calibration in YAML, as ROS has it: lasers: [...]", [&](const YAML::Node& document, int) {
            const YAML::Node lasers = document["lasers"];
            if (!lasers || !lasers.IsSequence() || lasers.size() != beams)
                throw YamlFault{fmt::format("expected lasers: a list of {}", beams),
                                lasers ? lasers.Mark() : YAML::Mark::null_mark()};
            std::vector<LidarBeam> out(beams);
            std::vector<bool> seen(beams);
            for (const YAML::Node& laser : lasers) {
                int id = -1;
                if (!laser.IsMap() || !laser["laser_id"] || !YAML::convert<int>::decode(laser["laser_id"], id) ||
                    id < 0 || static_cast<std::size_t>(id) >= beams || seen[static_cast<std::size_t>(id)])
                    throw YamlFault{fmt::format("laser_id: expected each of 0 to {} once", beams - 1),
                                    laser.Mark()};
                seen[static_cast<std::size_t>(id)] = true;
                out[static_cast<std::size_t>(id)] = read_beam(laser);
            }
            std::vector<std::string> unused;
            warn_of_file(document, beams, unused);
            if (warnings != nullptr)
                for (const std::string& what : unused) warnings->push_back(file + ": " + what);
            return out;
        });
}

}  // namespace narpa
