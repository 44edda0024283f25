/// protocols/lidar/lidar_model.h - the interface of a LiDAR: when and where its beams fire, and its packets.
///
/// A LidarMake is an instrument that scenes name. `configure` makes a LidarModel of it: one unit with its settings,
/// whose members never allocate or throw. Adding a make takes a pair of files that implement LidarModel and a line
/// in lidar_model.cpp; a program or a test may add its own at start with add_lidar_make().
///
/// Frame: x right, y forward, z up, as `look_at` in a scene assumes. Packet 0 starts at simulation time 0.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/vec3.h"

namespace narpa {

/// One laser pulse, in the LiDAR's frame.
struct LidarShot {
    std::int64_t t_offset_ns = 0;               ///< after the packet's start
    Vec3 origin_m{};                            ///< where the ray starts; its range counts from here
    Vec3 direction{};                           ///< unit
    double azimuth_rad = 0, elevation_rad = 0;  ///< the direction in the maker's angles
    int beam = 0;                               ///< laser number
    int block = 0;                              ///< of the packet
    bool fires = true;                          ///< false: the laser is off, as outside of a unit's window
};

/// One echo of a shot as the receiver measures it, before a packet rounds it.
struct LidarEcho {
    double range_m = 0;  ///< 0, negative or NaN: no echo
    /// Reflectance of a diffuse surface perpendicular to the beam that would return as much light from there; 1 is
    /// 100 %. Retroreflectors are above 1.
    float reflectivity = 0;
    double velocity_m_s = 0;  ///< of the surface along the beam, receding is positive; 0 where it is not measured
};

enum class LidarReturns : std::uint8_t {
    strongest,
    last,  ///< the farthest
    dual,  ///< both; if they are the same echo, the second strongest too
    strongest_two,
};

/// The echoes of one shot. A single echo is both `strongest` and `last`, and `second` is empty.
struct LidarEchoes {
    LidarEcho strongest, second, last;
    /// Sunlight from the surface that the axis meets and from the air before it, relative to a white surface that
    /// faces the Sun; 0 where it is not requested.
    float sunlight = 0;

    /// The echoes that a unit reports, in the order of its packets. The second is empty with a single echo, or in a
    /// mode of one return.
    [[nodiscard]] std::array<LidarEcho, 2> reported(LidarReturns returns) const noexcept {
        if (returns == LidarReturns::strongest) return {strongest, LidarEcho{}};
        if (returns == LidarReturns::last) return {last, LidarEcho{}};
        if (returns == LidarReturns::strongest_two) return {strongest, second};
        return {last, strongest.range_m == last.range_m ? second : strongest};
    }
};

/// One return, as a reader of the packet computes it.
struct LidarPoint {
    Vec3 origin_m{}, direction{};  ///< the beam; direction is unit
    double range_m = 0;            ///< > 0
    std::int64_t t_offset_ns = 0;  ///< after the packet's start
    int intensity = 0;             ///< on the maker's scale
    int beam = 0, shot = 0;        ///< laser number; index among the packet's shots
    int echo = 0;                  ///< 0, and 1 for the second one that a packet states of a shot
    double velocity_m_s = 0;       ///< as in LidarEcho

    [[nodiscard]] Vec3 position_m() const noexcept { return origin_m + range_m * direction; }
};

/// Where and when a shot was fired, as a reader of the packet computes it.
struct LidarAxis {
    Vec3 origin_m{}, direction{};  ///< direction is unit
    std::int64_t t_offset_ns = 0;  ///< after the packet's start
};

/// The field that each pulse lights, evenly by solid angle, where it is larger than the beam of one shot: the whole
/// field of view of a flash LiDAR. About the y axis of the LiDAR's frame.
struct LidarField {
    enum class Kind : std::uint8_t {
        beam,    ///< no more than each shot's own beam
        plane,   ///< a rectangle on a plane across y
        angles,  ///< a span of azimuths and one of elevations
    };
    Kind kind = Kind::beam;
    double horizontal = 0, vertical = 0;  ///< half extents: tangents of a plane, or radians

    /// `direction`: unit.
    [[nodiscard]] bool contains(const Vec3& direction) const noexcept;
    friend bool operator==(const LidarField&, const LidarField&) = default;
};

/// Default addresses and ports of the instrument on the network.
struct LidarNetwork {
    std::uint16_t data_port = 0, position_port = 0;
    std::array<std::uint8_t, 6> mac{};
    std::array<std::uint8_t, 4> address{};
    std::size_t datagram_bytes_max = 1472;  ///< of UDP payload; more than 1472 travel in several Ethernet frames

    /// Offset of the position port, kept when the data port is changed; 0: no position packets.
    [[nodiscard]] constexpr int position_port_offset() const noexcept {
        return position_port == 0 ? 0 : position_port - data_port;
    }
};

/// State of the pulse per second that a unit takes its time from.
enum class LidarPps : std::uint8_t { absent, synchronising, locked, error };

/// Calibration of one beam of a unit, as in its calibration file.
struct LidarBeam {
    double elevation_rad = 0;
    double azimuth_rad = 0;     ///< added to the rotor's; clockwise
    double range_offset_m = 0;  ///< added by readers to the range of a packet
    double height_m = 0;        ///< of the beam's origin above the sensor's
};

/// Settings of a unit. Members that its make does not have are ignored.
struct LidarSettings {
    double rate_hz = 0;  ///< turns or frames a second, within the make's limits
    LidarReturns returns = LidarReturns::strongest;
    LidarPps pps = LidarPps::locked;  ///< where its source is synchronised
    bool ptp = false;                 ///< takes its time by PTP: metadata say so
    std::vector<LidarBeam> beams{};   ///< of this unit, by laser number; empty: those of the make
    std::string profile{};            ///< format of the packets, one of the make's; empty: its default
    int columns = 0;                  ///< a turn, one of the make's; 0: its default
    std::string calibration{};        ///< text of the unit's file in the maker's own format; empty: as designed
};

/// UTC as a unit knows it.
struct LidarUtc {
    // NOLINTNEXTLINE(google-explicit-constructor): a number is a UTC whose source is synchronised
    constexpr LidarUtc(std::int64_t ns_since_1970, bool is_synchronised = true)
        : unix_ns(ns_since_1970), synchronised(is_synchronised) {}
    std::int64_t unix_ns;
    bool synchronised;  ///< else packets say that it is not, as far as the make does
};

/// Properties of one configured unit.
struct LidarSpec {
    std::string_view name;  ///< of the make
    double rate_hz = 0;
    LidarReturns returns = LidarReturns::strongest;
    std::int64_t packet_period_ns = 0;    ///< from one packet's start to the next one's; rounded down
    std::int64_t packet_complete_ns = 0;  ///< after its start, when it is sent; 0: when the next one starts
    std::size_t shots_per_packet = 0;
    std::size_t points_per_packet = 0;  ///< at most
    std::size_t data_packet_bytes = 0;
    std::size_t position_packet_bytes = 0;  ///< 0: the unit sends none
    int data_packets_per_position = 0;      ///< a position packet follows every n-th data packet
    double range_m_max = 0;                 ///< the largest range that a packet can hold
    double range_resolution_m = 0;          ///< ranges in packets are multiples of it
    std::int64_t time_resolution_ns = 1;    ///< of a packet's time stamp, which is rounded down
    bool measures_velocity = false;
    double velocity_resolution_m_s = 0;  ///< of velocities in packets
    bool measures_sunlight = false;
    LidarField lit{};
    LidarNetwork network{};
};

class LidarModel {
public:
    explicit LidarModel(const LidarSpec& spec) noexcept : spec_(spec) {}
    LidarModel(const LidarModel&) = delete;
    LidarModel& operator=(const LidarModel&) = delete;
    virtual ~LidarModel() = default;

    [[nodiscard]] const LidarSpec& spec() const noexcept { return spec_; }
    [[nodiscard]] virtual std::int64_t packet_start_ns(std::int64_t packet) const noexcept {
        return packet * spec_.packet_period_ns;
    }
    /// The first packet that starts at t_ns >= 0 or later.
    [[nodiscard]] virtual std::int64_t first_packet_from(std::int64_t t_ns) const noexcept {
        return (t_ns + spec_.packet_period_ns - 1) / spec_.packet_period_ns;
    }

    /// The turn or frame in which the packet starts: 0, 1, ... since simulation time 0.
    [[nodiscard]] virtual std::int64_t sweep(std::int64_t packet) const noexcept;

    /// Firing pattern: the packet's shots in firing order; they may be before its start. `out` has
    /// spec().shots_per_packet elements.
    virtual void shots(std::int64_t packet, std::span<LidarShot> out) const noexcept = 0;

    /// Writes a data packet of spec().data_packet_bytes. `echoes` has an element per shot. A range above
    /// range_m_max is no echo. `epoch`: UTC of simulation time 0.
    virtual void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                        std::span<std::uint8_t> out) const noexcept = 0;
    /// Writes the position (status) packet of this instant, of spec().position_packet_bytes.
    virtual void encode_position(LidarUtc /*now*/, std::span<std::uint8_t> /*out*/) const noexcept {}

    /// UTC of a data packet's start, ns since 1970. Where the stamp is ambiguous: the time nearest to
    /// `near_unix_ns`. Nothing: these bytes are not a data packet of this unit.
    [[nodiscard]] virtual std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                                                  std::int64_t near_unix_ns) const noexcept = 0;
    /// Why these bytes are not a data packet of this unit: what they have, and what was expected; empty: they are
    /// one. May allocate.
    [[nodiscard]] virtual std::string mismatch(std::span<const std::uint8_t> bytes) const;
    /// Decodes a data packet's returns in firing order and returns their number; 0 where it is no data packet of
    /// this unit. `out` has spec().points_per_packet elements.
    virtual std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept = 0;
    /// Decodes the shots that the packet states to have no return, in firing order, and returns their number; 0
    /// also where the format does not state them. `out` has spec().shots_per_packet elements.
    virtual std::size_t empty_shots(std::span<const std::uint8_t> /*bytes*/,
                                    std::span<LidarAxis> /*out*/) const noexcept {
        return 0;
    }

    /// Metadata of the unit, as a JSON file of the maker; empty: none. May allocate.
    [[nodiscard]] virtual std::string metadata() const { return {}; }

private:
    LidarSpec spec_;
};

/// A product of a maker of LiDARs.
struct LidarMake {
    std::string_view name;  ///< `model` of a scene's [[lidar]]
    double rate_hz_min = 0, rate_hz_max = 0, rate_hz_default = 0;
    double range_m_max = 0, range_m_default = 0;  ///< the largest that a packet can hold; the maker's rated range
    std::size_t beams = 0;                        ///< of a calibration file; 0: takes none
    bool dual = false;                            ///< has dual returns
    std::span<const std::string_view>
        profiles{};                  ///< formats of packets to choose from, which decide on the returns
    std::span<const int> columns{};  ///< of a turn, to choose from
    LidarNetwork network{};
    /// Fills in members of `settings` that are not set (0, empty), from the calibration text or the make's
    /// defaults. Errors: a bad calibration text, with a line; a combination that the make does not have, without.
    /// Null: nothing to fill in.
    std::function<Status(LidarSettings& settings)> complete{};
    /// `settings` are within the limits above.
    std::function<std::shared_ptr<const LidarModel>(const LidarSettings& settings)> configure;

    /// A unit with the default settings.
    [[nodiscard]] std::shared_ptr<const LidarModel> configure_default() const {
        return configure({.rate_hz = rate_hz_default});
    }
};

/// All makes, the built-in ones first.
[[nodiscard]] std::span<const LidarMake* const> lidar_makes() noexcept;
/// The make of this name; null where there is none.
[[nodiscard]] const LidarMake* find_lidar_make(std::string_view name) noexcept;
/// Adds a make, which must stay alive. To be called before any scene is read and any thread is started.
void add_lidar_make(const LidarMake& make);

}  // namespace narpa
