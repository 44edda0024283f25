#include "protocols/lidar/pattern_lidar.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "protocols/lidar/point_packet.h"

namespace narpa {
namespace {

constexpr LidarNetwork kPatternNetwork{.mac = {0x02, 0x4E, 0x4C, 0x50, 0x50, 0x01}, .address = {192, 168, 1, 202}};

Vec3 direction(double azimuth_rad, double elevation_rad) noexcept {
    return {std::cos(elevation_rad) * std::sin(azimuth_rad), std::cos(elevation_rad) * std::cos(azimuth_rad),
            std::sin(elevation_rad)};
}

/// The most shots that a packet holds and that divide the frame's.
std::size_t shots_per_packet(std::size_t shots, bool dual) noexcept {
    std::size_t n = std::min(shots, PointPacket::kMaxRecords / (dual ? 2 : 1));
    while (shots % n != 0) --n;
    return n;
}

std::uint32_t micro(double x) noexcept {
    return static_cast<std::uint32_t>(std::llround(1e6 * x));
}

LidarNetwork network_of(const LidarPattern& pattern) noexcept {
    LidarNetwork network = kPatternNetwork;
    network.data_port = pattern.data_port;
    return network;
}

class PatternLidar final : public LidarModel {
public:
    PatternLidar(std::shared_ptr<const LidarPattern> pattern, const LidarSettings& settings)
        : LidarModel(spec_of(*pattern, settings)),
          pattern_(std::move(pattern)),
          dual_(spec().returns == LidarReturns::dual),
          packets_(static_cast<std::int64_t>(pattern_->shots.size() / spec().shots_per_packet)),
          frame_ns_(frame_ns(settings)) {
        for (const PatternShot& s : pattern_->shots)
            directions_.push_back(direction(s.azimuth_rad, s.elevation_rad));
    }

    [[nodiscard]] std::int64_t packet_start_ns(std::int64_t packet) const noexcept override {
        return packet / packets_ * frame_ns_ + into_frame_ns(packet % packets_, packets_, frame_ns_);
    }
    [[nodiscard]] std::int64_t first_packet_from(std::int64_t t_ns) const noexcept override {
        std::int64_t packet = t_ns / frame_ns_ * packets_ + t_ns % frame_ns_ * packets_ / frame_ns_;
        while (packet_start_ns(packet) < t_ns) ++packet;
        return packet;
    }
    [[nodiscard]] std::int64_t sweep(std::int64_t packet) const noexcept override { return packet / packets_; }

    void shots(std::int64_t packet, std::span<LidarShot> out) const noexcept override {
        const std::int64_t place = packet % packets_;
        const std::size_t first = first_shot(place);
        for (std::size_t i = 0; i < out.size(); ++i) {
            const PatternShot& s = pattern_->shots[first + i];
            out[i] = {.t_offset_ns = into_frame_ns(s) - into_frame_ns(place, packets_, frame_ns_),
                      .direction = directions_[first + i],
                      .azimuth_rad = s.azimuth_rad,
                      .elevation_rad = s.elevation_rad,
                      .beam = s.beam,
                      .block = static_cast<int>(place)};
        }
    }

    void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                std::span<std::uint8_t> out) const noexcept override {
        const std::int64_t frame = packet / packets_, place = packet % packets_;
        const std::size_t first = first_shot(place), each = dual_ ? 2 : 1;
        for (std::size_t i = 0; i < echoes.size(); ++i) {
            const auto reported = echoes[i].reported(spec().returns);
            for (std::size_t e = 0; e < each; ++e)
                PointPacket::put(record(pattern_->shots[first + i], reported[e]), each * i + e, out);
        }
        PointPacket{.dual = dual_,
                    .records = static_cast<std::uint16_t>(each * echoes.size()),
                    .frame = static_cast<std::uint32_t>(frame),
                    .first_shot = static_cast<std::uint32_t>(first),
                    .shots_per_frame = static_cast<std::uint32_t>(pattern_->shots.size()),
                    .frame_unix_ns = epoch.unix_ns + packet_start_ns(packet - place),
                    .range_step_um = micro(pattern_->range_resolution_m),
                    .velocity_step_um_s = micro(pattern_->velocity_resolution_m_s)}
            .write(out);
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t) const noexcept override {
        const auto p = read(bytes);
        if (!p) return std::nullopt;
        return p->frame_unix_ns + into_frame_ns(place_of(*p), packets_, frame_ns_);
    }

    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        const auto p = read(bytes);
        if (!p) return 0;
        std::size_t count = 0;
        const std::size_t each = dual_ ? 2 : 1;
        for (std::size_t i = 0; i < p->records; ++i) {
            const PointRecord r = PointPacket::record(bytes, i);
            if (r.range == 0) continue;
            LidarPoint& point = out[count++];
            point = {};
            point.direction = direction_of(r);
            point.range_m = 1e-6 * p->range_step_um * r.range;
            point.t_offset_ns = into_packet_ns(r, *p);
            point.intensity = r.reflectivity;
            point.beam = r.beam;
            point.shot = static_cast<int>(i / each);
            point.echo = static_cast<int>(i % each);
            if (r.velocity != PointRecord::kNoVelocity)
                point.velocity_m_s = 1e-6 * p->velocity_step_um_s * r.velocity;
        }
        return count;
    }

    std::size_t empty_shots(std::span<const std::uint8_t> bytes, std::span<LidarAxis> out) const noexcept override {
        const auto p = read(bytes);
        if (!p) return 0;
        std::size_t count = 0;
        const std::size_t each = dual_ ? 2 : 1;
        for (std::size_t i = 0; i < p->records; i += each) {
            const PointRecord r = PointPacket::record(bytes, i);
            if (r.range != 0 || PointPacket::record(bytes, i + each - 1).range != 0) continue;
            out[count++] = {.direction = direction_of(r), .t_offset_ns = into_packet_ns(r, *p)};
        }
        return count;
    }

private:
    static std::int64_t frame_ns(const LidarSettings& settings) { return std::llround(1e9 / settings.rate_hz); }
    /// Start of packet `place` after the start of its frame.
    static std::int64_t into_frame_ns(std::int64_t place, std::int64_t packets, std::int64_t frame_ns) noexcept {
        return place * frame_ns / packets;
    }
    static LidarSpec spec_of(const LidarPattern& pattern, const LidarSettings& settings) {
        const bool dual = settings.returns == LidarReturns::dual;
        const std::size_t each = shots_per_packet(pattern.shots.size(), dual),
                          packets = pattern.shots.size() / each;
        const std::int64_t frame = frame_ns(settings);
        std::int64_t last_ns = 0;  // the last shot of any packet, after the packet's start
        for (std::size_t place = 0; place < packets; ++place) {
            const double phase = pattern.shots[(place + 1) * each - 1].phase;
            const std::int64_t start_ns =
                into_frame_ns(static_cast<std::int64_t>(place), static_cast<std::int64_t>(packets), frame);
            last_ns = std::max<std::int64_t>(last_ns, std::llround(phase * static_cast<double>(frame)) - start_ns);
        }
        return {.name = pattern.name,
                .rate_hz = settings.rate_hz,
                .returns = settings.returns,
                .packet_period_ns = frame / static_cast<std::int64_t>(packets),
                .packet_complete_ns = 1 + last_ns + std::llround(1e9 * pattern.latency_s),
                .shots_per_packet = each,
                .points_per_packet = each * (dual ? 2 : 1),
                .data_packet_bytes = PointPacket::bytes(each * (dual ? 2 : 1)),
                .range_m_max = pattern.range_resolution_m * UINT32_MAX,
                .range_resolution_m = pattern.range_resolution_m,
                .measures_velocity = pattern.velocity_resolution_m_s > 0,
                .velocity_resolution_m_s = pattern.velocity_resolution_m_s,
                .lit = pattern.lit,
                .network = network_of(pattern)};
    }

    [[nodiscard]] std::size_t first_shot(std::int64_t place) const noexcept {
        return static_cast<std::size_t>(place) * spec().shots_per_packet;
    }
    [[nodiscard]] std::int64_t place_of(const PointPacket& p) const noexcept {
        return p.first_shot / static_cast<std::int64_t>(spec().shots_per_packet);
    }
    [[nodiscard]] std::int64_t into_frame_ns(const PatternShot& s) const noexcept {
        return std::llround(s.phase * static_cast<double>(frame_ns_));
    }

    [[nodiscard]] std::int64_t into_packet_ns(const PointRecord& r, const PointPacket& p) const noexcept {
        return r.t_offset_ns - into_frame_ns(place_of(p), packets_, frame_ns_);
    }
    [[nodiscard]] static Vec3 direction_of(const PointRecord& r) noexcept {
        return direction(r.azimuth / PointRecord::kAngleSteps_per_rad,
                         r.elevation / PointRecord::kAngleSteps_per_rad);
    }

    [[nodiscard]] PointRecord record(const PatternShot& s, const LidarEcho& echo) const noexcept {
        PointRecord r{.t_offset_ns = static_cast<std::uint32_t>(into_frame_ns(s)),
                      .azimuth = static_cast<std::int32_t>(std::llround(s.azimuth_rad * r.kAngleSteps_per_rad)),
                      .elevation = static_cast<std::int32_t>(std::llround(s.elevation_rad * r.kAngleSteps_per_rad)),
                      .beam = static_cast<std::uint16_t>(s.beam)};
        const double steps = echo.range_m / pattern_->range_resolution_m;
        if (!(steps >= 0.5 && steps < UINT32_MAX)) return r;
        r.range = static_cast<std::uint32_t>(std::llround(steps));
        r.reflectivity = static_cast<std::uint16_t>(
            std::lround(std::clamp(static_cast<double>(echo.reflectivity) * r.kReflectivitySteps, 0.0, 65535.0)));
        if (spec().measures_velocity)
            r.velocity = static_cast<std::int32_t>(std::llround(
                std::clamp(echo.velocity_m_s / pattern_->velocity_resolution_m_s, -2147483647.0, 2147483647.0)));
        return r;
    }

    /// The packet if it is of this instrument in this return mode.
    [[nodiscard]] std::optional<PointPacket> read(std::span<const std::uint8_t> bytes) const noexcept {
        auto p = PointPacket::read(bytes);
        if (p && (bytes.size() != spec().data_packet_bytes || p->dual != dual_ ||
                  p->shots_per_frame != pattern_->shots.size() || p->first_shot % spec().shots_per_packet != 0 ||
                  p->first_shot >= p->shots_per_frame || p->range_step_um != micro(pattern_->range_resolution_m) ||
                  p->velocity_step_um_s != micro(pattern_->velocity_resolution_m_s)))
            p.reset();
        return p;
    }

    std::shared_ptr<const LidarPattern> pattern_;
    bool dual_;
    std::int64_t packets_, frame_ns_;  ///< of a frame
    std::vector<Vec3> directions_;
};

/// The parts one after the other.
template <class... Part>
Error fault(const Part&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    return Error{text.str()};
}

bool whole_micro(double x) {
    return x >= 1e-6 && x <= 1e3 && std::abs(1e6 * x - std::round(1e6 * x)) < 1e-6;
}

Status check_shots(const std::vector<PatternShot>& shots) {
    if (shots.empty() || shots.size() > LidarPattern::kMaxShots)
        return fault(shots.size(), " shots a frame, expected 1 to ", LidarPattern::kMaxShots);
    for (std::size_t i = 0; i < shots.size(); ++i) {
        const PatternShot& s = shots[i];
        const auto wrong = [&](const char* what) { return fault("shot ", i, ": ", what); };
        if (!(std::abs(s.azimuth_rad) <= 4 * std::numbers::pi)) return wrong("azimuth, expected at most 720 deg");
        if (!(std::abs(s.elevation_rad) <= 0.5 * std::numbers::pi))
            return wrong("elevation, expected at most 90 deg");
        if (!(s.phase >= 0 && s.phase < 1)) return wrong("phase, expected in [0, 1)");
        if (i > 0 && s.phase < shots[i - 1].phase) return wrong("fires before the shot above it");
        if (s.beam < 0 || s.beam > 65535) return wrong("beam, expected 0 to 65535");
    }
    return Ok{};
}

Status check(const LidarPattern& p) {
    if (Status shots = check_shots(p.shots); !shots) return shots;
    if (!whole_micro(p.range_resolution_m))
        return Error{"range_resolution_m: expected whole micrometres up to 1000 m"};
    if (p.velocity_resolution_m_s != 0 && !whole_micro(p.velocity_resolution_m_s))
        return Error{"velocity_resolution_m_s: expected whole micrometres a second up to 1000 m/s"};
    if (!(p.rate_hz_min > 0 && p.rate_hz_min <= p.rate_hz_default && p.rate_hz_default <= p.rate_hz_max))
        return Error{"rate_hz: expected 0 < rate_hz_min <= rate_hz <= rate_hz_max"};
    if (!(p.latency_s >= 0 && 1 / p.rate_hz_min + p.latency_s <= LidarPattern::kLongest_s))
        return fault("a frame at ", p.rate_hz_min, " Hz and the latency of ", p.latency_s, " s: expected at most ",
                     LidarPattern::kLongest_s, " s together");
    const auto packets = static_cast<double>(p.shots.size() / shots_per_packet(p.shots.size(), p.dual));
    constexpr double kMaxPackets_hz = 1e5;
    if (!(packets * p.rate_hz_max <= kMaxPackets_hz))
        return fault(packets, " packets a frame at ", p.rate_hz_max, " Hz, expected at most ", kMaxPackets_hz,
                     " a second",
                     packets * 8 > static_cast<double>(p.shots.size())
                         ? "; a number of shots that has a large divisor up to 59 makes fewer"
                         : "");
    return Ok{};
}

}  // namespace

Result<LidarMake> make_of(std::shared_ptr<const LidarPattern> pattern) {
    if (Status good = check(*pattern); !good) return good.error();
    const LidarPattern& p = *pattern;
    return LidarMake{.name = p.name,
                     .rate_hz_min = p.rate_hz_min,
                     .rate_hz_max = p.rate_hz_max,
                     .rate_hz_default = p.rate_hz_default,
                     .range_m_max = p.range_resolution_m * UINT32_MAX,
                     .range_m_default = p.range_m_default,
                     .dual = p.dual,
                     .network = network_of(p),
                     .configure = [pattern = std::move(pattern)](const LidarSettings& settings) {
                         return std::make_shared<const PatternLidar>(pattern, settings);
                     }};
}

}  // namespace narpa
