#include "protocols/lidar/vlp16.h"

#include <cmath>
#include <numbers>

#include "protocols/little_endian.h"

namespace narpa::vlp16 {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr int kAzimuthTurn = 36'000;  // hundredths of a degree
constexpr std::uint32_t kHourUs = 3'600'000'000;
constexpr std::size_t kTimeOffset = kBlocks * kBlockBytes, kModeOffset = kTimeOffset + 4,
                      kProductOffset = kModeOffset + 1;

constexpr std::size_t block_offset(int block) {
    return static_cast<std::size_t>(block) * kBlockBytes;
}
constexpr std::size_t return_offset(int shot) {
    return block_offset(shot / kShotsPerBlock) + 4 + 3 * static_cast<std::size_t>(shot % kShotsPerBlock);
}

std::uint16_t to_azimuth_cdeg(double revolutions) {
    return static_cast<std::uint16_t>(std::lround(revolutions * kAzimuthTurn) % kAzimuthTurn);
}

std::uint16_t to_range_2mm(double range_m) {
    if (!(range_m > 0 && range_m <= kRangeMaxM)) return 0;  // NaN too
    return static_cast<std::uint16_t>(std::lround(range_m / kRangeQuantumM));
}

std::uint8_t to_reflectivity(float reflectivity) {
    if (!(reflectivity > 0)) return 0;
    return reflectivity >= 1 ? std::uint8_t{100} : static_cast<std::uint8_t>(std::lround(100 * reflectivity));
}

std::uint32_t past_hour_us(std::int64_t unix_ns) {
    constexpr std::int64_t hour_ns = 1000 * std::int64_t{kHourUs};
    const std::int64_t ns = unix_ns % hour_ns;
    return static_cast<std::uint32_t>((ns < 0 ? ns + hour_ns : ns) / 1000);
}

// From this block's azimuth to the next one's; the last block has no next and takes the gap before it.
int azimuth_gap_cdeg(const DataPacket& packet, int block) {
    const int from = block + 1 < kBlocks ? block : block - 1;
    const int gap = packet.azimuth_cdeg[from + 1] - packet.azimuth_cdeg[from];
    return gap < 0 ? gap + kAzimuthTurn : gap;
}

}  // namespace

Vec3 direction(double azimuth_rad, double elevation_rad) noexcept {
    const double horizontal = std::cos(elevation_rad);
    return {horizontal * std::sin(azimuth_rad), horizontal * std::cos(azimuth_rad), std::sin(elevation_rad)};
}

double rotor_revolutions(std::int64_t t_ns, double rotation_hz) noexcept {
    constexpr std::int64_t second = 1'000'000'000;
    // Whole seconds apart, so that a long run keeps its angle.
    const double whole = std::fmod(static_cast<double>(t_ns / second) * rotation_hz, 1.0);
    const double turns = whole + static_cast<double>(t_ns % second) * rotation_hz * 1e-9;
    const double fraction = turns - std::floor(turns);
    return fraction < 1 ? fraction : 0.0;
}

void shots(std::int64_t packet, double rotation_hz, std::span<Shot, kShots> out) noexcept {
    for (int i = 0; i < kShots; ++i) {
        const int laser = i % kLasers;
        Shot& shot = out[i];
        shot.t_offset_ns = shot_offset_ns(i);
        shot.azimuth_rad =
            2 * std::numbers::pi * rotor_revolutions(packet_start_ns(packet) + shot.t_offset_ns, rotation_hz);
        shot.elevation_rad = kElevationDeg[laser] * kRadPerDeg;
        shot.origin_height_m = kOriginHeightM[laser];
        shot.laser = laser;
    }
}

void encode(std::int64_t packet, double rotation_hz, std::int64_t epoch_unix_ns,
            std::span<const double, kShots> range_m, std::span<const float, kShots> reflectivity,
            std::span<std::uint8_t, kDataPacketBytes> out) noexcept {
    const std::int64_t start_ns = packet_start_ns(packet);
    for (int block = 0; block < kBlocks; ++block) {
        std::uint8_t* at = out.data() + block_offset(block);
        at[0] = 0xFF;
        at[1] = 0xEE;
        put_le(at + 2, to_azimuth_cdeg(rotor_revolutions(start_ns + block * kBlockPeriodNs, rotation_hz)));
    }
    for (int i = 0; i < kShots; ++i) {
        std::uint8_t* at = out.data() + return_offset(i);
        const std::uint16_t range_2mm = to_range_2mm(range_m[i]);
        put_le(at, range_2mm);
        at[2] = range_2mm == 0 ? std::uint8_t{0} : to_reflectivity(reflectivity[i]);
    }
    put_le(out.data() + kTimeOffset, past_hour_us(epoch_unix_ns + start_ns));
    out[kModeOffset] = kReturnStrongest;
    out[kProductOffset] = kProductVlp16;
}

std::optional<DataPacket> decode(std::span<const std::uint8_t> bytes) noexcept {
    constexpr std::uint8_t last_return = 0x38;
    if (bytes.size() != kDataPacketBytes) return std::nullopt;
    DataPacket packet;
    packet.past_hour_us = get_le<std::uint32_t>(&bytes[kTimeOffset]);
    packet.return_mode = bytes[kModeOffset];
    packet.product = bytes[kProductOffset];
    if (packet.past_hour_us >= kHourUs || packet.product != kProductVlp16) return std::nullopt;
    if (packet.return_mode != kReturnStrongest && packet.return_mode != last_return) return std::nullopt;
    for (int block = 0; block < kBlocks; ++block) {
        const std::uint8_t* at = &bytes[block_offset(block)];
        packet.azimuth_cdeg[block] = get_le<std::uint16_t>(at + 2);
        if (at[0] != 0xFF || at[1] != 0xEE || packet.azimuth_cdeg[block] >= kAzimuthTurn) return std::nullopt;
    }
    for (int i = 0; i < kShots; ++i) {
        packet.range_2mm[i] = get_le<std::uint16_t>(&bytes[return_offset(i)]);
        packet.reflectivity[i] = bytes[return_offset(i) + 2];
    }
    return packet;
}

std::size_t points(const DataPacket& packet, std::span<Point, kShots> out) noexcept {
    std::size_t count = 0;
    for (int i = 0; i < kShots; ++i) {
        if (packet.range_2mm[i] == 0) continue;
        const int block = i / kShotsPerBlock, laser = i % kLasers;
        const double into_block =
            static_cast<double>(shot_offset_ns(i) - block * kBlockPeriodNs) / static_cast<double>(kBlockPeriodNs);
        const double azimuth_cdeg =
            std::fmod(packet.azimuth_cdeg[block] + into_block * azimuth_gap_cdeg(packet, block), kAzimuthTurn);
        Point& point = out[count++];
        point.range_m = packet.range_2mm[i] * kRangeQuantumM;
        point.azimuth_rad = azimuth_cdeg * 0.01 * kRadPerDeg;
        point.elevation_rad = kElevationDeg[laser] * kRadPerDeg;
        point.position_m = point.range_m * direction(point.azimuth_rad, point.elevation_rad);
        point.position_m.z += kOriginHeightM[laser];
        point.t_offset_ns = shot_offset_ns(i);
        point.reflectivity = packet.reflectivity[i];
        point.laser = static_cast<std::uint8_t>(laser);
        point.shot = static_cast<std::uint16_t>(i);
    }
    return count;
}

}  // namespace narpa::vlp16
