#include "renderer/assets/lidar_calibration.h"

#include <fmt/format.h>

#include <cmath>

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

Result<std::vector<LidarBeam>> read_lidar_calibration(const std::string& file, std::size_t beams) {
    return read_yaml<std::vector<LidarBeam>>(
        file, "a LiDAR's calibration in YAML, as ROS has it: lasers: [...]", [&](const YAML::Node& document) {
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
            return out;
        });
}

}  // namespace narpa
