#include "estimator/batch/batch_unknowns.h"

#include <fmt/format.h>

#include <cmath>

#include "estimator/pose/pose_estimate.h"

namespace narpa {
namespace {

constexpr std::array<BatchUnknownRow, kBatchUnknowns> kBatchRows{{
    {"scale", 1, 0.02, true, true, true},
    {"focal", 1, 0.02, true, true, false},
    {"aspect", 1, 0.01, false, true, false},
    {"centre_px.x", 1, 5, true, true, false},
    {"centre_px.y", 1, 5, true, true, false},
    {"k1", 1, 0.1, true, true, false},
    {"k2", 1, 0.1, false, true, false},
    {"p1", 1, 0.01, false, true, false},
    {"p2", 1, 0.01, false, true, false},
    {"k3", 1, 0.1, false, true, false},
    {"camera_mount_deg.x", kDegree, 0.5, true, true, false},
    {"camera_mount_deg.y", kDegree, 0.5, true, true, false},
    {"camera_mount_deg.z", kDegree, 0.5, true, true, false},
    {"camera_mount_m.x", 1, 0.02, false, true, false},
    {"camera_mount_m.y", 1, 0.02, false, true, false},
    {"camera_mount_m.z", 1, 0.02, false, true, false},
    {"lidar_mount_deg.x", kDegree, 0.5, true, false, true},
    {"lidar_mount_deg.y", kDegree, 0.5, true, false, true},
    {"lidar_mount_deg.z", kDegree, 0.5, true, false, true},
    {"lidar_mount_m.x", 1, 0.02, false, false, true},
    {"lidar_mount_m.y", 1, 0.02, false, false, true},
    {"lidar_mount_m.z", 1, 0.02, false, false, true},
    {"clock_s", 1, 0.05, true, true, true},
    {"range_bias_m", 1, 0.05, true, false, true},
    {"albedo", 1, 0.1, true, true, false},
    {"light_deg.x", kDegree, 1, true, true, false},
    {"light_deg.y", kDegree, 1, true, true, false},
}};

}  // namespace

std::span<const BatchUnknownRow, kBatchUnknowns> batch_unknowns() noexcept {
    return kBatchRows;
}

std::string_view group_of(std::string_view name) noexcept {
    return name.substr(0, name.find('.'));
}

std::string help_of_batch_unknowns() {
    std::string text;
    std::string_view last;
    for (const BatchUnknownRow& row : kBatchRows) {
        const std::string_view group = group_of(row.name);
        if (group == last) continue;
        last = group;
        text += fmt::format("{}{} {:g}{}", text.empty() ? "" : ", ", group, row.default_sigma,
                            row.by_default ? "" : " (only if named)");
    }
    return text;
}

std::array<Vec3, 2> light_axes(const Vec3& direction) {
    constexpr double kNearPole = 0.866;
    const Vec3 pole = std::abs(direction.z) < kNearPole ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
    const Vec3 across = normalized(cross(pole, direction));
    return {across, normalized(cross(direction, across))};
}

BatchValues default_batch_priors() {
    BatchValues sigmas{};
    for (std::size_t i = 0; i < kBatchUnknowns; ++i)
        if (kBatchRows[i].by_default) sigmas[i] = kBatchRows[i].unit * kBatchRows[i].default_sigma;
    return sigmas;
}

BatchValues all_batch_priors() {
    BatchValues sigmas{};
    for (std::size_t i = 0; i < kBatchUnknowns; ++i) sigmas[i] = kBatchRows[i].unit * kBatchRows[i].default_sigma;
    return sigmas;
}

bool is_of_sensors(const BatchUnknownRow& row, bool camera, bool lidar) noexcept {
    return (camera && row.of_camera) || (lidar && row.of_lidar);
}

}  // namespace narpa
