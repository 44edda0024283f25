#include "protocols/lidar/velodyne.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "base/constants.h"
#include "base/time.h"
#include "protocols/lidar/reflectivity_code.h"
#include "protocols/lidar/velodyne_packet.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr int kBlocks = VelodynePacket::kBlocks, kShotsPerBlock = VelodynePacket::kReturnsPerBlock;
constexpr std::uint8_t kNoReflectivity = 255;  // without a return; README.md, "Data packet"
constexpr double kRangeQuantumM = 0.002, kRangeMaxM = 65535 * kRangeQuantumM;
constexpr std::int64_t kHour_ns = 3600 * kSecond_ns;
constexpr double kRotorMost_hz = 25;  // the makes' 20 and a margin

// Position packet: unused, time stamp, PPS state, unused, NMEA sentence and zeros (VLP-16 manual, section 9.3.3).
constexpr std::size_t kPositionTimeOffset = 198, kPpsOffset = kPositionTimeOffset + 4,
                      kSentenceOffset = kPpsOffset + 1 + 3, kPositionPacketBytes = kSentenceOffset + 306;

/// Properties in which the products differ.
struct Product {
    std::string_view name;
    std::uint8_t code;
    std::span<const double> elevation_deg;  ///< by laser number, which is also the firing order
    std::span<const double> height_m;       ///< of each laser above the sensor's origin; empty: none
    std::int64_t laser_period_ns, sequence_period_ns;
    double range_m_default;

    [[nodiscard]] constexpr int lasers() const noexcept { return static_cast<int>(elevation_deg.size()); }
    [[nodiscard]] constexpr std::int64_t block_period_ns() const noexcept {
        return kShotsPerBlock / lasers() * sequence_period_ns;
    }
    /// Time of a shot after the block's start.
    [[nodiscard]] constexpr std::int64_t shot_offset_ns(int shot_in_block) const noexcept {
        return shot_in_block / lasers() * sequence_period_ns + shot_in_block % lasers() * laser_period_ns;
    }
};

constexpr std::array<double, 16> kVlp16ElevationDeg{-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
/// Table 9-1, "vertical correction". A ray starts at (0, 0, height) and its range counts from there: a reader that
/// adds the correction to z, as the manual asks, gets the surface; one that does not (PCL) is up to 11.2 mm off in
/// z, as with the instrument. README.md, "Where a ray starts".
constexpr std::array<double, 16> kVlp16HeightM{0.0112, -0.0007, 0.0097, -0.0022, 0.0081, -0.0037, 0.0066, -0.0051,
                                               0.0051, -0.0066, 0.0037, -0.0081, 0.0022, -0.0097, 0.0007, -0.0112};
constexpr std::array<double, 32> kHdl32ElevationDeg{-30.67, -9.33, -29.33, -8,    -28,    -6.67, -26.67, -5.33,
                                                    -25.33, -4,    -24,    -2.67, -22.67, -1.33, -21.33, 0,
                                                    -20,    1.33,  -18.67, 2.67,  -17.33, 4,     -16,    5.33,
                                                    -14.67, 6.67,  -13.33, 8,     -12,    9.33,  -10.67, 10.67};

constexpr Product kVlp16{.name = "VLP-16",
                         .code = 0x22,
                         .elevation_deg = kVlp16ElevationDeg,
                         .height_m = kVlp16HeightM,
                         .laser_period_ns = 2'304,
                         .sequence_period_ns = 24 * 2'304,  // 16 lasers and a recharge
                         .range_m_default = 100};
constexpr Product kHdl32e{.name = "HDL-32E",
                          .code = 0x21,
                          .elevation_deg = kHdl32ElevationDeg,
                          .height_m = {},
                          .laser_period_ns = 1'152,
                          .sequence_period_ns = 40 * 1'152,  // 32 lasers and a recharge
                          .range_m_default = 100};

constexpr LidarNetwork kNetwork{.data_port = 2368,
                                .position_port = 8308,
                                .mac = {0x60, 0x76, 0x88, 0, 0, 0},  // the maker's prefix
                                .address = {192, 168, 1, 201}};

/// [0, 1)
double fraction_of(double turns) {
    const double fraction = turns - std::floor(turns);
    return fraction < 1 ? fraction : 0.0;
}

/// Azimuth of the rotor in revolutions, [0, 1). Whole seconds are reduced separately, so that a long run keeps the
/// precision.
double rotor_revolutions(std::int64_t t_ns, double rotation_hz) {
    const std::int64_t seconds = t_ns / kSecond_ns;
    const double whole = std::fmod(static_cast<double>(seconds) * rotation_hz, 1.0);
    return fraction_of(whole + static_cast<double>(t_ns % kSecond_ns) * rotation_hz * 1e-9);
}

std::uint16_t to_azimuth_cdeg(double revolutions) {
    return static_cast<std::uint16_t>(std::lround(revolutions * VelodynePacket::kAzimuthTurn) %
                                      VelodynePacket::kAzimuthTurn);
}

std::uint16_t to_range_2mm(double range_m) {
    if (!(range_m > 0 && range_m <= kRangeMaxM)) return 0;  // NaN too
    return static_cast<std::uint16_t>(std::lround(range_m / kRangeQuantumM));
}

std::string hex(std::uint8_t value) {
    std::array<char, 3> text{};
    std::snprintf(text.data(), text.size(), "%02X", unsigned{value});
    return text.data();
}

std::uint32_t past_hour_us(std::int64_t unix_ns) {
    const std::int64_t ns = unix_ns % kHour_ns;
    return static_cast<std::uint32_t>((ns < 0 ? ns + kHour_ns : ns) / 1000);
}

/// The GPRMC sentence of this instant with checksum, carriage return and line feed; years 1970 to 2069. Status A
/// (valid) or V. Latitude and longitude are 0: NMEA holds a spacecraft's time, not its position.
void put_sentence(std::chrono::sys_time<std::chrono::nanoseconds> now, bool valid, std::uint8_t* out) {
    using namespace std::chrono;
    const year_month_day date{floor<days>(now)};
    const hh_mm_ss time{floor<seconds>(now) - floor<days>(now)};
    std::array<char, 160> text{};
    const int size = std::snprintf(
        text.data(), text.size(),
        "$GPRMC,%02d%02d%02d,%c,0000.0000,N,00000.0000,E,000.0,000.0,%02u%02u%02d,000.0,E*",
        static_cast<int>(time.hours().count()), static_cast<int>(time.minutes().count()),
        static_cast<int>(time.seconds().count()), valid ? 'A' : 'V', static_cast<unsigned>(date.day()),
        static_cast<unsigned>(date.month()), static_cast<int>(date.year()) % 100);
    // NMEA 0183: exclusive or of the characters between `$` and `*`.
    unsigned sum = 0;
    for (int i = 1; i + 1 < size; ++i) sum ^= static_cast<unsigned char>(text[i]);
    const int tail = std::snprintf(text.data() + size, text.size() - size, "%02X\r\n", sum);
    std::copy_n(text.data(), size + tail, out);
}

class Velodyne final : public LidarModel {
public:
    Velodyne(const Product& product, const LidarSettings& settings)
        : LidarModel(spec_of(product, settings)),
          product_(product),
          settings_(settings),
          dual_(settings.returns == LidarReturns::dual) {
        if (settings_.beams.empty())
            for (int laser = 0; laser < product.lasers(); ++laser)
                settings_.beams.push_back({.elevation_rad = product.elevation_deg[laser] * kRadPerDeg,
                                           .height_m = product.height_m.empty() ? 0 : product.height_m[laser]});
        for (const LidarBeam& b : settings_.beams) {
            cos_elevation_.push_back(std::cos(b.elevation_rad));
            sin_elevation_.push_back(std::sin(b.elevation_rad));
        }
        for (int i = 0; i < kShotsPerBlock; ++i) {
            const int laser = i % product_.lasers();
            const LidarBeam& beam = settings_.beams[laser];
            LidarShot shot{.t_offset_ns = product_.shot_offset_ns(i),
                           .origin_m = {0, 0, beam.height_m},
                           .elevation_rad = beam.elevation_rad,
                           .beam = laser};
            const double turned = 1e-9 * static_cast<double>(shot.t_offset_ns) * spec().rate_hz;
            shot.direction = direction(2 * std::numbers::pi * turned + beam.azimuth_rad, laser);
            block_.push_back({shot, turned});
        }
    }

    void shots(std::int64_t packet, std::span<LidarShot> out) const noexcept override {
        for (int block = 0; !out.empty(); ++block, out = out.subspan(kShotsPerBlock)) {
            const std::int64_t begin_ns = block * product_.block_period_ns();
            const double rotor = rotor_revolutions(packet_start_ns(packet) + begin_ns, spec().rate_hz);
            const double s = std::sin(2 * std::numbers::pi * rotor), c = std::cos(2 * std::numbers::pi * rotor);
            for (std::size_t i = 0; i < kShotsPerBlock; ++i) {
                const auto& [at_zero, turned] = block_[i];
                const Vec3 d = at_zero.direction;
                LidarShot& shot = out[i] = at_zero;
                shot.t_offset_ns += begin_ns;
                shot.azimuth_rad =
                    2 * std::numbers::pi * fraction_of(rotor + turned) + settings_.beams[shot.beam].azimuth_rad;
                shot.direction = {c * d.x + s * d.y, c * d.y - s * d.x, d.z};
                shot.block = dual_ ? 2 * block : block;
            }
        }
    }

    void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                std::span<std::uint8_t> out) const noexcept override {
        VelodynePacket p;
        for (int b = 0; b < kBlocks; ++b) {
            const int firing = dual_ ? b / 2 : b;
            const std::int64_t t_ns = packet_start_ns(packet) + firing * product_.block_period_ns();
            p.blocks[b].azimuth_cdeg = to_azimuth_cdeg(rotor_revolutions(t_ns, spec().rate_hz));
            for (int k = 0; k < kShotsPerBlock; ++k)
                p.blocks[b].returns[k] = to_return(echo_in_block(echoes[firing * kShotsPerBlock + k], b),
                                                   settings_.beams[k % product_.lasers()].range_offset_m);
        }
        p.past_hour_us = past_hour_us(epoch.unix_ns + packet_start_ns(packet));
        p.mode = mode();
        p.product = product_.code;
        p.write(out.first<VelodynePacket::kBytes>());
    }

    void encode_position(LidarUtc now, std::span<std::uint8_t> out) const noexcept override {
        const LidarPps pps =
            settings_.pps == LidarPps::locked && !now.synchronised ? LidarPps::synchronising : settings_.pps;
        std::ranges::fill(out, std::uint8_t{0});
        put_le(&out[kPositionTimeOffset], past_hour_us(now.unix_ns));
        out[kPpsOffset] = static_cast<std::uint8_t>(pps);
        put_sentence(std::chrono::sys_time<std::chrono::nanoseconds>{std::chrono::nanoseconds{now.unix_ns}},
                     pps == LidarPps::locked, &out[kSentenceOffset]);
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t near_unix_ns) const noexcept override {
        const auto packet = read(bytes);
        if (!packet) return std::nullopt;
        std::int64_t off_ns = (1000 * std::int64_t{packet->past_hour_us} - near_unix_ns) % kHour_ns;
        if (off_ns < -kHour_ns / 2) off_ns += kHour_ns;
        if (off_ns >= kHour_ns / 2) off_ns -= kHour_ns;
        return near_unix_ns + off_ns;
    }

    std::string mismatch(std::span<const std::uint8_t> bytes) const override {
        if (bytes.size() != VelodynePacket::kBytes)
            return std::to_string(bytes.size()) + " bytes, expected " + std::to_string(VelodynePacket::kBytes);
        const auto packet = VelodynePacket::read(bytes);
        if (!packet) return "a block's flag, an azimuth or a return mode that no packet has";
        if (packet->product != product_.code)
            return "product " + hex(packet->product) + ", expected " + hex(product_.code);
        if (!read(bytes))
            return "return mode " + hex(packet->mode) + ", expected " + hex(mode()) + ", as the scene has it";
        return {};
    }

    /// As the manual computes them: precision azimuth (section 9.5) and vertical correction applied.
    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        const auto packet = read(bytes);
        if (!packet) return 0;
        const Turns turns = turns_of(*packet);
        std::size_t count = 0;
        const int echoes = dual_ ? 2 : 1;
        for (int i = 0; i < kBlocks / echoes * kShotsPerBlock; ++i)
            for (int echo = 0; echo < echoes; ++echo) {
                const int block = i / kShotsPerBlock * echoes + echo, in_block = i % kShotsPerBlock;
                const VelodynePacket::Return& r = packet->blocks[block].returns[in_block];
                if (r.range_2mm == 0) continue;
                if (echo == 1 && r == packet->blocks[block - 1].returns[in_block]) continue;  // the same echo
                const LidarAxis axis = axis_of(*packet, turns, block, in_block);
                const int laser = in_block % product_.lasers();
                LidarPoint& point = out[count];
                point = {};
                point.origin_m = axis.origin_m;
                point.direction = axis.direction;
                point.range_m = r.range_2mm * kRangeQuantumM + settings_.beams[laser].range_offset_m;
                point.t_offset_ns = axis.t_offset_ns;
                point.intensity = r.reflectivity;
                point.beam = laser;
                point.shot = i;
                point.echo = echo;
                count += point.range_m > 0 ? 1 : 0;
            }
        return count;
    }

    std::size_t empty_shots(std::span<const std::uint8_t> bytes, std::span<LidarAxis> out) const noexcept override {
        const auto packet = read(bytes);
        if (!packet) return 0;
        const Turns turns = turns_of(*packet);
        std::size_t count = 0;
        const int echoes = dual_ ? 2 : 1;
        for (int block = 0; block < kBlocks; block += echoes)
            for (int k = 0; k < kShotsPerBlock; ++k)
                if (packet->blocks[block].returns[k].range_2mm == 0 &&
                    packet->blocks[block + echoes - 1].returns[k].range_2mm == 0)
                    out[count++] = axis_of(*packet, turns, block, k);
        return count;
    }

private:
    static LidarSpec spec_of(const Product& product, const LidarSettings& settings) {
        const int firings = settings.returns == LidarReturns::dual ? kBlocks / 2 : kBlocks;
        return {.name = product.name,
                .rate_hz = settings.rate_hz,
                .returns = settings.returns,
                .packet_period_ns = firings * product.block_period_ns(),
                .shots_per_packet = static_cast<std::size_t>(firings * kShotsPerBlock),
                .points_per_packet = kBlocks * kShotsPerBlock,
                .data_packet_bytes = VelodynePacket::kBytes,
                .position_packet_bytes = kPositionPacketBytes,
                .data_packets_per_position = 14 * kBlocks / firings,  // VLP-16 manual, section 8.2.2
                .range_m_max = kRangeMaxM,
                .range_resolution_m = kRangeQuantumM,
                .time_resolution_ns = 1000,
                .network = kNetwork};
    }

    [[nodiscard]] std::uint8_t mode() const noexcept {
        switch (settings_.returns) {
            case LidarReturns::strongest: return VelodynePacket::strongest;
            case LidarReturns::last: return VelodynePacket::last;
            case LidarReturns::dual: return VelodynePacket::dual;
            case LidarReturns::strongest_two: break;  // not of this maker
        }
        return VelodynePacket::strongest;
    }

    /// The packet if it is of this product and return mode. Packets of the two single modes differ only in the
    /// mode, so either one is accepted.
    [[nodiscard]] std::optional<VelodynePacket> read(std::span<const std::uint8_t> bytes) const noexcept {
        auto packet = VelodynePacket::read(bytes);
        if (packet && (packet->product != product_.code || (packet->mode == VelodynePacket::dual) != dual_))
            packet.reset();
        return packet;
    }

    /// The echo of a shot that this block states. Where there is one only, both blocks of a pair state it.
    [[nodiscard]] LidarEcho echo_in_block(const LidarEchoes& e, int block) const noexcept {
        const auto reported = e.reported(settings_.returns);
        return dual_ && block % 2 == 1 && reported[1].range_m > 0 ? reported[1] : reported[0];
    }

    [[nodiscard]] static VelodynePacket::Return to_return(const LidarEcho& echo, double range_offset_m) noexcept {
        const std::uint16_t range_2mm = to_range_2mm(echo.range_m - (echo.range_m > 0 ? range_offset_m : 0));
        return {range_2mm, range_2mm == 0 ? kNoReflectivity : reflectivity_code(echo.reflectivity)};
    }

    using Turns = std::array<int, kBlocks>;
    [[nodiscard]] Turns turns_of(const VelodynePacket& p) const noexcept {
        const auto turn_at = [&](double rate_hz) {
            return static_cast<int>(std::lround(1e-9 * static_cast<double>(product_.block_period_ns()) * rate_hz *
                                                VelodynePacket::kAzimuthTurn));
        };
        return p.turns_cdeg(dual_ ? 2 : 1, turn_at(spec().rate_hz), turn_at(kRotorMost_hz));
    }

    [[nodiscard]] LidarAxis axis_of(const VelodynePacket& p, const Turns& turns, int block,
                                    int in_block) const noexcept {
        const int echoes = dual_ ? 2 : 1, laser = in_block % product_.lasers();
        const std::int64_t into_block_ns = product_.shot_offset_ns(in_block);
        const double turned = static_cast<double>(into_block_ns) / static_cast<double>(product_.block_period_ns());
        const double azimuth_cdeg = p.blocks[block].azimuth_cdeg + turns[block] * turned;
        const LidarBeam& beam = settings_.beams[laser];
        return {.origin_m = {0, 0, beam.height_m},
                .direction = direction(azimuth_cdeg * 0.01 * kRadPerDeg + beam.azimuth_rad, laser),
                .t_offset_ns = block / echoes * product_.block_period_ns() + into_block_ns};
    }

    /// (cos w sin a, cos w cos a, sin w)
    [[nodiscard]] Vec3 direction(double azimuth_rad, int laser) const noexcept {
        const double horizontal = cos_elevation_[laser];
        return {horizontal * std::sin(azimuth_rad), horizontal * std::cos(azimuth_rad), sin_elevation_[laser]};
    }

    /// A shot of the first block as if that started at azimuth 0, and how far the rotor has turned by then.
    struct BlockShot {
        LidarShot at_zero;
        double revolutions;
    };

    const Product& product_;
    LidarSettings settings_;
    bool dual_;
    std::vector<double> cos_elevation_, sin_elevation_;
    std::vector<BlockShot> block_;
};

LidarMake make_of(const Product& product) {
    return {.name = product.name,
            .rate_hz_min = 5,
            .rate_hz_max = 20,
            .rate_hz_default = 10,
            .range_m_max = kRangeMaxM,
            .range_m_default = product.range_m_default,
            .beams = static_cast<std::size_t>(product.lasers()),
            .dual = true,
            .network = kNetwork,
            .configure = [&product](const LidarSettings& settings) {
                return std::make_shared<const Velodyne>(product, settings);
            }};
}

}  // namespace

const LidarMake& vlp16() noexcept {
    static const LidarMake make = make_of(kVlp16);
    return make;
}

const LidarMake& hdl32e() noexcept {
    static const LidarMake make = make_of(kHdl32e);
    return make;
}

}  // namespace narpa
