#include "protocols/lidar/livox.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::int64_t kLivoxPacket_ns = static_cast<std::int64_t>(LivoxPacket::kPoints) * LivoxPacket::kPoint_ns;
constexpr std::int64_t kLivoxFrame_ns = 100'000'000;
constexpr double kLivoxPoints_hz = 1e9 / LivoxPacket::kPoint_ns;
constexpr double kLivoxStep_m = 1e-3;
constexpr int kLivoxLines = 4;
constexpr std::uint8_t kCartesian32 = 1;
constexpr std::uint8_t kNoSource = 0, kPtp = 1;  // of time
// Offsets of the header's fields.
struct LivoxAt {
    static constexpr std::size_t kVersion = 0, kLength = 1, kTimeInterval = 3, kDotNum = 5, kUdpCount = 7,
                                 kFrameCount = 9, kDataType = 10, kTimeType = 11, kCrc = 24, kTimestamp = 28;
};
static_assert(LivoxAt::kTimestamp + 8 == LivoxPacket::kHeaderBytes && LivoxPacket::kBytes == 1380);
constexpr auto kTimeInterval_100ns =  // from the first point to the last
    static_cast<std::uint16_t>((LivoxPacket::kPoints - 1) * LivoxPacket::kPoint_ns / 100);

/// 0 to 150: diffuse surfaces of 0 to 100 %; above: retroreflectors, whose scale the manual does not give: here the
/// logarithm of 1 to 1000 times white.
std::uint8_t reflectivity_code_of(float reflectivity) noexcept {
    if (!(reflectivity > 0)) return 0;
    const double code = reflectivity <= 1 ? std::round(150.0 * static_cast<double>(reflectivity))
                                          : 151 + 104 * std::log10(static_cast<double>(reflectivity)) / 3;
    return static_cast<std::uint8_t>(std::min(code, 255.0));
}

/// In steps of a millimetre, along the maker's axes.
std::array<std::uint32_t, 3> millimetres(const Vec3& p) noexcept {
    const auto steps = [](double m) { return static_cast<std::uint32_t>(std::lround(m / kLivoxStep_m)); };
    return {steps(p.y), steps(-p.x), steps(p.z)};
}

LidarSpec spec_of() {
    return {.name = "Mid-360",
            .rate_hz = LivoxRosette::kTurns_hz,
            .packet_period_ns = kLivoxPacket_ns,
            .shots_per_packet = LivoxPacket::kPoints,
            .points_per_packet = LivoxPacket::kPoints,
            .data_packet_bytes = LivoxPacket::kBytes,
            .range_m_max = 2e6,  // coordinates have 32 bits
            .range_resolution_m = kLivoxStep_m,
            .network = mid360().network};
}

class Mid360 final : public LidarModel {
public:
    Mid360() : LidarModel(spec_of()) {}

    [[nodiscard]] std::int64_t sweep(std::int64_t packet) const noexcept override {
        return packet * kLivoxPacket_ns / kLivoxFrame_ns;
    }

    void shots(std::int64_t packet, std::span<LidarShot> out) const noexcept override {
        assert(packet >= 0 && out.size() == LivoxPacket::kPoints);
        for (std::size_t i = 0; i < out.size(); ++i) {
            const auto k = static_cast<std::int64_t>(i);
            const Vec3 d = LivoxRosette::direction(packet * static_cast<std::int64_t>(out.size()) + k);
            out[i] = {.t_offset_ns = k * LivoxPacket::kPoint_ns,
                      .direction = d,
                      .azimuth_rad = std::atan2(d.x, d.y),
                      .elevation_rad = std::asin(d.z),
                      .beam = static_cast<int>(i) % kLivoxLines};
        }
    }

    void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                std::span<std::uint8_t> out) const noexcept override {
        assert(echoes.size() == LivoxPacket::kPoints && out.size() == LivoxPacket::kBytes);
        std::ranges::fill(out, std::uint8_t{0});
        const std::int64_t frame = sweep(packet);
        const std::int64_t first = (frame * kLivoxFrame_ns + kLivoxPacket_ns - 1) / kLivoxPacket_ns;
        put_le(&out[LivoxAt::kLength], static_cast<std::uint16_t>(LivoxPacket::kBytes));
        put_le(&out[LivoxAt::kTimeInterval], kTimeInterval_100ns);
        put_le(&out[LivoxAt::kDotNum], static_cast<std::uint16_t>(LivoxPacket::kPoints));
        put_le(&out[LivoxAt::kUdpCount], static_cast<std::uint16_t>(packet - first));
        out[LivoxAt::kFrameCount] = static_cast<std::uint8_t>(frame);
        out[LivoxAt::kDataType] = kCartesian32;
        out[LivoxAt::kTimeType] = epoch.synchronised ? kPtp : kNoSource;
        put_le(&out[LivoxAt::kTimestamp], static_cast<std::uint64_t>(epoch.unix_ns + packet_start_ns(packet)));
        for (std::size_t i = 0; i < echoes.size(); ++i) put_point(packet, i, echoes[i].strongest, out);
        put_le(&out[LivoxAt::kCrc], crc32(out.subspan(LivoxAt::kTimestamp)));
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t) const noexcept override {
        if (!is_ours(bytes)) return std::nullopt;
        return static_cast<std::int64_t>(get_le<std::uint64_t>(&bytes[LivoxAt::kTimestamp]));
    }

    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        if (!is_ours(bytes)) return 0;
        std::size_t count = 0;
        for (std::size_t i = 0; i < LivoxPacket::kPoints; ++i) {
            const std::uint8_t* const at = &bytes[LivoxPacket::kHeaderBytes + i * LivoxPacket::kPointBytes];
            const auto axis = [at](std::size_t k) {
                return kLivoxStep_m * static_cast<std::int32_t>(get_le<std::uint32_t>(at + 4 * k));
            };
            const Vec3 p{-axis(1), axis(0), axis(2)};
            const double range = norm(p);
            if (!(range > 0)) continue;
            LidarPoint& point = out[count++];
            point = {};
            point.direction = p / range;
            point.range_m = range;
            point.t_offset_ns = static_cast<std::int64_t>(i) * LivoxPacket::kPoint_ns;
            point.intensity = at[12];
            point.beam = static_cast<int>(i) % kLivoxLines;
            point.shot = static_cast<int>(i);
        }
        return count;
    }

private:
    /// A point without an echo has zero coordinates.
    static void put_point(std::int64_t packet, std::size_t i, const LidarEcho& echo,
                          std::span<std::uint8_t> out) noexcept {
        if (!(echo.range_m >= 0.5 * kLivoxStep_m && echo.range_m <= 2e6)) return;
        const std::int64_t n = packet * static_cast<std::int64_t>(LivoxPacket::kPoints);
        const auto steps = millimetres(echo.range_m * LivoxRosette::direction(n + static_cast<std::int64_t>(i)));
        std::uint8_t* const at = &out[LivoxPacket::kHeaderBytes + i * LivoxPacket::kPointBytes];
        for (std::size_t k = 0; k < 3; ++k) put_le(at + 4 * k, steps[k]);
        at[12] = reflectivity_code_of(echo.reflectivity);
    }

    [[nodiscard]] static bool is_ours(std::span<const std::uint8_t> bytes) noexcept {
        return bytes.size() == LivoxPacket::kBytes && bytes[LivoxAt::kVersion] == 0 &&
               get_le<std::uint16_t>(&bytes[LivoxAt::kLength]) == LivoxPacket::kBytes &&
               get_le<std::uint16_t>(&bytes[LivoxAt::kDotNum]) == LivoxPacket::kPoints &&
               bytes[LivoxAt::kDataType] == kCartesian32 &&
               get_le<std::uint64_t>(&bytes[LivoxAt::kTimestamp]) >> 63 == 0 &&
               get_le<std::uint32_t>(&bytes[LivoxAt::kCrc]) == crc32(bytes.subspan(LivoxAt::kTimestamp));
    }
};

}  // namespace

Vec3 LivoxRosette::direction(std::int64_t n) noexcept {
    const auto angle = [n](double cycles_hz) {
        const double cycles = static_cast<double>(n) * (cycles_hz / kLivoxPoints_hz);
        return 2 * std::numbers::pi * (cycles - std::floor(cycles));
    };
    constexpr double kMiddle_deg = 0.5 * (kHighest_deg + kLowest_deg),
                     kSwing_deg = 0.5 * (kHighest_deg - kLowest_deg);
    const double azimuth = angle(kTurns_hz);
    const double elevation =
        (kMiddle_deg + kSwing_deg * std::sin(angle(kTurns_hz * kSwingsPerTurn))) * std::numbers::pi / 180;
    return {std::cos(elevation) * std::sin(azimuth), std::cos(elevation) * std::cos(azimuth), std::sin(elevation)};
}

const LidarMake& mid360() noexcept {
    static const LidarMake make{
        .name = "Mid-360",
        .rate_hz_min = LivoxRosette::kTurns_hz,
        .rate_hz_max = LivoxRosette::kTurns_hz,
        .rate_hz_default = LivoxRosette::kTurns_hz,
        .range_m_max = 2e6,
        .range_m_default = 70,
        .network = {.data_port = 56301, .mac = {0x02, 0x4E, 0x4C, 0x4D, 0x33, 0x36}, .address = {192, 168, 1, 100}},
        .configure = [](const LidarSettings&) { return std::make_shared<const Mid360>(); }};
    return make;
}

}  // namespace narpa
