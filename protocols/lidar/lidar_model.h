/// protocols/lidar/lidar_model.h - the interface of a LiDAR model: when and where its beams fire, and its packets.
///
/// A model is a stateless object of static lifetime. Adding one takes a pair of files that implement LidarModel and
/// a line in lidar_model.cpp; a program or a test may add its own at start with add_lidar_model().
///
/// Frame: x right, y forward, z up, as `look_at` in a scene assumes. Packet p = 0, 1, ... starts p periods after
/// simulation time 0. Nothing here allocates or throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "base/vec3.h"

namespace narpa {

/// One laser pulse, in the LiDAR's frame.
struct LidarShot {
    std::int64_t t_offset_ns = 0;               ///< after the packet's first shot
    Vec3 origin_m{};                            ///< where the ray starts; its range counts from here
    Vec3 direction{};                           ///< unit
    double azimuth_rad = 0, elevation_rad = 0;  ///< the direction in the maker's angles
    int beam = 0;                               ///< laser number
    int block = 0;                              ///< of the packet
};

/// One return, as a reader of the packet computes it.
struct LidarPoint {
    Vec3 origin_m{}, direction{};  ///< the beam; direction is unit
    double range_m = 0;            ///< > 0
    std::int64_t t_offset_ns = 0;  ///< after the packet's first shot
    int intensity = 0;             ///< on the maker's scale
    int beam = 0, shot = 0;        ///< laser number; index among the packet's shots

    [[nodiscard]] Vec3 position_m() const noexcept { return origin_m + range_m * direction; }
};

/// How the instrument appears on the network by default.
struct LidarNetwork {
    std::uint16_t data_port = 0, position_port = 0;
    std::array<std::uint8_t, 6> mac{};
    std::array<std::uint8_t, 4> address{};

    /// Position packets keep this distance from the data port wherever that is moved to; 0: there are none.
    [[nodiscard]] constexpr int position_port_offset() const noexcept {
        return position_port == 0 ? 0 : position_port - data_port;
    }
};

struct LidarSpec {
    std::string_view name;  ///< `model` of a scene's [[lidar]]
    std::size_t shots_per_packet = 0;
    std::size_t data_packet_bytes = 0;
    std::size_t position_packet_bytes = 0;  ///< 0: the model sends none
    int data_packets_per_position = 0;      ///< a position packet follows every n-th data packet
    double rate_hz_min = 0, rate_hz_max = 0, rate_hz_default = 0;  ///< turns (sweeps) a second
    double range_m_max = 0;                                        ///< the largest range that a packet can hold
    double range_m_default = 0;                                    ///< the maker's rated range
    double range_resolution_m = 0;                                 ///< ranges in packets are multiples of it
    std::int64_t time_resolution_ns = 1;  ///< of a packet's time stamp, which is rounded down
    LidarNetwork network{};
};

class LidarModel {
public:
    explicit constexpr LidarModel(const LidarSpec& spec) noexcept : spec_(spec) {}
    LidarModel(const LidarModel&) = delete;
    LidarModel& operator=(const LidarModel&) = delete;

    [[nodiscard]] const LidarSpec& spec() const noexcept { return spec_; }

    /// From one packet's first shot to the next one's. `rate_hz` is within the spec's limits, here and below.
    [[nodiscard]] virtual std::int64_t packet_period_ns(double rate_hz) const noexcept = 0;
    [[nodiscard]] std::int64_t packet_start_ns(std::int64_t packet, double rate_hz) const noexcept {
        return packet * packet_period_ns(rate_hz);
    }
    /// The first packet that starts at t_ns >= 0 or later.
    [[nodiscard]] std::int64_t first_packet_from(std::int64_t t_ns, double rate_hz) const noexcept {
        const std::int64_t period_ns = packet_period_ns(rate_hz);
        return (t_ns + period_ns - 1) / period_ns;
    }

    /// Firing pattern: the packet's shots in firing order. `out` has spec().shots_per_packet elements.
    virtual void shots(std::int64_t packet, double rate_hz, std::span<LidarShot> out) const noexcept = 0;

    /// Writes a data packet of spec().data_packet_bytes. `range_m` and `reflectivity` have an element per shot. A
    /// range that is 0, negative, NaN or above range_m_max is no return. Reflectivity is that of a diffuse surface,
    /// 1 = 100 %. `epoch_unix_ns`: UTC of simulation time 0, ns since 1970.
    virtual void encode(std::int64_t packet, double rate_hz, std::int64_t epoch_unix_ns,
                        std::span<const double> range_m, std::span<const float> reflectivity,
                        std::span<std::uint8_t> out) const noexcept = 0;
    /// Writes the position (status) packet of this instant, of spec().position_packet_bytes.
    virtual void encode_position(std::int64_t unix_ns, std::span<std::uint8_t> out) const noexcept = 0;

    /// UTC of a data packet's first shot, ns since 1970. Where the stamp is ambiguous: the time nearest to
    /// `near_unix_ns`. Nothing: these bytes are not a data packet of this model.
    [[nodiscard]] virtual std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                                                  std::int64_t near_unix_ns) const noexcept = 0;
    /// Decodes a data packet's returns in firing order and returns their number; 0 where it is no data packet of
    /// this model. `out` has spec().shots_per_packet elements.
    virtual std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept = 0;

protected:
    ~LidarModel() = default;

private:
    LidarSpec spec_;
};

/// All models, the built-in ones first.
[[nodiscard]] std::span<const LidarModel* const> lidar_models() noexcept;
/// The model of this name; null where there is none.
[[nodiscard]] const LidarModel* find_lidar_model(std::string_view name) noexcept;
/// Adds a model that outlives the program's use of it. Before any scene is read and any thread is started.
void add_lidar_model(const LidarModel& model);

}  // namespace narpa
