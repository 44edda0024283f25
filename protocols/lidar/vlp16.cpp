#include "protocols/lidar/vlp16.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "base/constants.h"
#include "base/time.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr int kLasers = 16, kSequencesPerBlock = 2, kBlocks = 12;
constexpr int kShotsPerBlock = kLasers * kSequencesPerBlock, kShots = kShotsPerBlock * kBlocks;
constexpr std::int64_t kLaserPeriodNs = 2'304;                   // from one laser to the next
constexpr std::int64_t kSequencePeriodNs = 24 * kLaserPeriodNs;  // 16 lasers and a recharge
constexpr std::int64_t kBlockPeriodNs = kSequencesPerBlock * kSequencePeriodNs;
constexpr std::int64_t kPacketPeriodNs = kBlocks * kBlockPeriodNs;

// Data packet: per block a flag, an azimuth and 32 returns of range and reflectivity; time stamp, return mode,
// product.
constexpr std::size_t kReturnBytes = 2 + 1, kBlockBytes = 2 + 2 + kShotsPerBlock * kReturnBytes;
constexpr std::size_t kTimeOffset = kBlocks * kBlockBytes, kModeOffset = kTimeOffset + 4,
                      kProductOffset = kModeOffset + 1, kDataPacketBytes = kProductOffset + 1;
constexpr std::uint8_t kNoReflectivity = 255;  // without a return; README.md, "Data packet"
constexpr std::uint8_t kReturnStrongest = 0x37, kReturnLast = 0x38, kProductVlp16 = 0x22;

// Position packet: unused, time stamp, PPS state, unused, NMEA sentence and zeros (section 9.3.3).
constexpr std::size_t kPositionTimeOffset = 198, kPpsOffset = kPositionTimeOffset + 4,
                      kSentenceOffset = kPpsOffset + 1 + 3, kPositionPacketBytes = kSentenceOffset + 306;
constexpr std::uint8_t kPpsLocked = 2;

constexpr double kRangeQuantumM = 0.002, kRangeMaxM = 65535 * kRangeQuantumM;
constexpr int kAzimuthTurn = 36'000;  // hundredths of a degree
constexpr std::int64_t kHour_ns = 3600 * kSecond_ns, kHour_us = kHour_ns / 1000;

/// Elevation in degrees by laser number, which is also the firing order (table 9-1).
constexpr std::array<double, kLasers> kElevationDeg{-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
/// Height of each laser above the sensor's origin, metres (table 9-1, "vertical correction"). A ray starts at
/// (0, 0, height) and its range counts from there: a reader that adds the correction to z, as the manual asks, gets
/// the surface; one that does not (PCL) is up to 11.2 mm off in z, as with the instrument. README.md, "Where a ray
/// starts".
constexpr std::array<double, kLasers> kOriginHeightM{0.0112, -0.0007, 0.0097, -0.0022, 0.0081, -0.0037,
                                                     0.0066, -0.0051, 0.0051, -0.0066, 0.0037, -0.0081,
                                                     0.0022, -0.0097, 0.0007, -0.0112};

constexpr LidarSpec kSpec{
    .name = "VLP-16",
    .shots_per_packet = kShots,
    .data_packet_bytes = kDataPacketBytes,
    .position_packet_bytes = kPositionPacketBytes,
    .data_packets_per_position = 14,  // section 8.2.2
    .rate_hz_min = 5,
    .rate_hz_max = 20,
    .rate_hz_default = 10,
    .range_m_max = kRangeMaxM,
    .range_m_default = 100,
    .range_resolution_m = kRangeQuantumM,
    .time_resolution_ns = 1000,
    .network = {.data_port = 2368,
                .position_port = 8308,
                .mac = {0x60, 0x76, 0x88, 0, 0, 0},  // the maker's prefix
                .address = {192, 168, 1, 201}},
};

constexpr std::size_t block_offset(int block) {
    return static_cast<std::size_t>(block) * kBlockBytes;
}
constexpr std::size_t return_offset(int shot) {
    return block_offset(shot / kShotsPerBlock) + 4 + kReturnBytes * static_cast<std::size_t>(shot % kShotsPerBlock);
}
/// After the packet's first shot.
constexpr std::int64_t shot_offset_ns(int shot) {
    return shot / kLasers * kSequencePeriodNs + shot % kLasers * kLaserPeriodNs;
}

/// Azimuth of the rotor in revolutions, [0, 1). Whole seconds are taken apart, so that a long run keeps its angle.
double rotor_revolutions(std::int64_t t_ns, double rotation_hz) {
    const std::int64_t seconds = t_ns / kSecond_ns;
    const double whole = std::fmod(static_cast<double>(seconds) * rotation_hz, 1.0);
    const double turns = whole + static_cast<double>(t_ns % kSecond_ns) * rotation_hz * 1e-9;
    const double fraction = turns - std::floor(turns);
    return fraction < 1 ? fraction : 0.0;
}

std::uint16_t to_azimuth_cdeg(double revolutions) {
    return static_cast<std::uint16_t>(std::lround(revolutions * kAzimuthTurn) % kAzimuthTurn);
}

std::uint16_t to_range_2mm(double range_m) {
    if (!(range_m > 0 && range_m <= kRangeMaxM)) return 0;  // NaN too
    return static_cast<std::uint16_t>(std::lround(range_m / kRangeQuantumM));
}

std::uint8_t to_percent(float reflectivity) {
    if (!(reflectivity > 0)) return 0;
    return reflectivity >= 1 ? std::uint8_t{100} : static_cast<std::uint8_t>(std::lround(100 * reflectivity));
}

std::uint32_t past_hour_us(std::int64_t unix_ns) {
    const std::int64_t ns = unix_ns % kHour_ns;
    return static_cast<std::uint32_t>((ns < 0 ? ns + kHour_ns : ns) / 1000);
}

std::uint16_t azimuth_cdeg(std::span<const std::uint8_t> packet, int block) {
    return get_le<std::uint16_t>(&packet[block_offset(block) + 2]);
}

/// The length, the flags, the azimuths, the time stamp and the product are those of a VLP-16, in single return
/// mode: the blocks of a dual return packet come in pairs.
bool is_data_packet(std::span<const std::uint8_t> packet) {
    if (packet.size() != kDataPacketBytes || packet[kProductOffset] != kProductVlp16) return false;
    if (packet[kModeOffset] != kReturnStrongest && packet[kModeOffset] != kReturnLast) return false;
    for (int block = 0; block < kBlocks; ++block) {
        const std::uint8_t* flag = &packet[block_offset(block)];
        if (flag[0] != 0xFF || flag[1] != 0xEE || azimuth_cdeg(packet, block) >= kAzimuthTurn) return false;
    }
    return get_le<std::uint32_t>(&packet[kTimeOffset]) < kHour_us;
}

/// From this block's azimuth to the next one's; the last block has no next and takes the gap before it.
int azimuth_gap_cdeg(std::span<const std::uint8_t> packet, int block) {
    const int from = block + 1 < kBlocks ? block : block - 1;
    const int gap = azimuth_cdeg(packet, from + 1) - azimuth_cdeg(packet, from);
    return gap < 0 ? gap + kAzimuthTurn : gap;
}

/// The GPRMC sentence of this instant, status A (valid), with checksum, carriage return and line feed; years 1970
/// to 2069. Latitude and longitude are 0: NMEA holds a spacecraft's time, not its position.
void put_sentence(std::chrono::sys_time<std::chrono::nanoseconds> now, std::uint8_t* out) {
    using namespace std::chrono;
    const year_month_day date{floor<days>(now)};
    const hh_mm_ss time{floor<seconds>(now) - floor<days>(now)};
    std::array<char, 160> text{};
    const int size =
        std::snprintf(text.data(), text.size(),
                      "$GPRMC,%02d%02d%02d,A,0000.0000,N,00000.0000,E,000.0,000.0,%02u%02u%02d,000.0,E*",
                      static_cast<int>(time.hours().count()), static_cast<int>(time.minutes().count()),
                      static_cast<int>(time.seconds().count()), static_cast<unsigned>(date.day()),
                      static_cast<unsigned>(date.month()), static_cast<int>(date.year()) % 100);
    // NMEA 0183: exclusive or of the characters between `$` and `*`.
    unsigned sum = 0;
    for (int i = 1; i + 1 < size; ++i) sum ^= static_cast<unsigned char>(text[i]);
    const int tail = std::snprintf(text.data() + size, text.size() - size, "%02X\r\n", sum);
    std::copy_n(text.data(), size + tail, out);
}

class Vlp16 final : public LidarModel {
public:
    Vlp16() noexcept : LidarModel(kSpec) {
        for (int laser = 0; laser < kLasers; ++laser) {
            const double elevation_rad = kElevationDeg[laser] * kRadPerDeg;
            cos_elevation_[laser] = std::cos(elevation_rad);
            sin_elevation_[laser] = std::sin(elevation_rad);
        }
    }

    std::int64_t packet_period_ns(double) const noexcept override { return kPacketPeriodNs; }

    void shots(std::int64_t packet, double rate_hz, std::span<LidarShot> out) const noexcept override {
        for (int i = 0; i < kShots; ++i) {
            const int laser = i % kLasers;
            const std::int64_t t_ns = packet * kPacketPeriodNs + shot_offset_ns(i);
            LidarShot& shot = out[i];
            shot.t_offset_ns = shot_offset_ns(i);
            shot.azimuth_rad = 2 * std::numbers::pi * rotor_revolutions(t_ns, rate_hz);
            shot.elevation_rad = kElevationDeg[laser] * kRadPerDeg;
            shot.origin_m = {0, 0, kOriginHeightM[laser]};
            shot.direction = direction(shot.azimuth_rad, laser);
            shot.beam = laser;
            shot.block = i / kShotsPerBlock;
        }
    }

    void encode(std::int64_t packet, double rate_hz, std::int64_t epoch_unix_ns, std::span<const double> range_m,
                std::span<const float> reflectivity, std::span<std::uint8_t> out) const noexcept override {
        const std::int64_t start_ns = packet * kPacketPeriodNs;
        for (int block = 0; block < kBlocks; ++block) {
            std::uint8_t* at = out.data() + block_offset(block);
            at[0] = 0xFF;
            at[1] = 0xEE;
            put_le(at + 2, to_azimuth_cdeg(rotor_revolutions(start_ns + block * kBlockPeriodNs, rate_hz)));
        }
        for (int i = 0; i < kShots; ++i) {
            std::uint8_t* at = out.data() + return_offset(i);
            const std::uint16_t range_2mm = to_range_2mm(range_m[i]);
            put_le(at, range_2mm);
            at[2] = range_2mm == 0 ? kNoReflectivity : to_percent(reflectivity[i]);
        }
        put_le(out.data() + kTimeOffset, past_hour_us(epoch_unix_ns + start_ns));
        out[kModeOffset] = kReturnStrongest;
        out[kProductOffset] = kProductVlp16;
    }

    void encode_position(std::int64_t unix_ns, std::span<std::uint8_t> out) const noexcept override {
        std::ranges::fill(out, std::uint8_t{0});
        put_le(&out[kPositionTimeOffset], past_hour_us(unix_ns));
        out[kPpsOffset] = kPpsLocked;
        put_sentence(std::chrono::sys_time<std::chrono::nanoseconds>{std::chrono::nanoseconds{unix_ns}},
                     &out[kSentenceOffset]);
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t near_unix_ns) const noexcept override {
        if (!is_data_packet(bytes)) return std::nullopt;
        const std::int64_t stamp_ns = 1000 * std::int64_t{get_le<std::uint32_t>(&bytes[kTimeOffset])};
        std::int64_t off_ns = (stamp_ns - near_unix_ns) % kHour_ns;
        if (off_ns < -kHour_ns / 2) off_ns += kHour_ns;
        if (off_ns >= kHour_ns / 2) off_ns -= kHour_ns;
        return near_unix_ns + off_ns;
    }

    /// As the manual computes them: precision azimuth (section 9.5) and vertical correction applied.
    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        if (!is_data_packet(bytes)) return 0;
        std::size_t count = 0;
        for (int i = 0; i < kShots; ++i) {
            const std::uint8_t* at = &bytes[return_offset(i)];
            const auto range_2mm = get_le<std::uint16_t>(at);
            if (range_2mm == 0) continue;
            const int block = i / kShotsPerBlock, laser = i % kLasers;
            const double into_block = static_cast<double>(shot_offset_ns(i) - block * kBlockPeriodNs) /
                                      static_cast<double>(kBlockPeriodNs);
            const double cdeg =
                std::fmod(azimuth_cdeg(bytes, block) + into_block * azimuth_gap_cdeg(bytes, block), kAzimuthTurn);
            LidarPoint& point = out[count++];
            point.origin_m = {0, 0, kOriginHeightM[laser]};
            point.direction = direction(cdeg * 0.01 * kRadPerDeg, laser);
            point.range_m = range_2mm * kRangeQuantumM;
            point.t_offset_ns = shot_offset_ns(i);
            point.intensity = at[2];
            point.beam = laser;
            point.shot = i;
        }
        return count;
    }

private:
    /// (cos w sin a, cos w cos a, sin w)
    [[nodiscard]] Vec3 direction(double azimuth_rad, int laser) const noexcept {
        const double horizontal = cos_elevation_[laser];
        return {horizontal * std::sin(azimuth_rad), horizontal * std::cos(azimuth_rad), sin_elevation_[laser]};
    }

    std::array<double, kLasers> cos_elevation_{}, sin_elevation_{};
};

}  // namespace

const LidarModel& vlp16() noexcept {
    static const Vlp16 model;
    return model;
}

}  // namespace narpa
