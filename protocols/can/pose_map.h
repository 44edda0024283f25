/// protocols/can/pose_map.h - the pose of a body from messages of a user's own bus, in place of narpa's pose
/// command.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocols/can/dbc_reader.h"
#include "protocols/can/messages/pose_command.h"

namespace narpa {

/// A number of a pose: a signal of one of the messages.
struct MappedNumber {
    std::size_t message = 0;  ///< index into PoseMap::messages
    DbcSignal signal{};
    double to_si = 1;  ///< m, m/s, rad/s, s or 1 of the signal's unit
};

/// Which messages and signals are a body's pose. A command is complete when each message has come once; one that
/// comes again before that replaces the first.
struct PoseMap {
    std::vector<DbcMessage> messages{};
    std::array<MappedNumber, 3> position{};
    std::array<MappedNumber, 4> attitude_wxyz{};
    std::optional<std::array<MappedNumber, 3>> velocity{}, rate{};  ///< absent: 0
    /// Time of validity on the simulation clock; a whole number that wraps is the one nearest to the present.
    /// Absent: when the last message came.
    std::optional<MappedNumber> time{};
    bool world_to_body = false;  ///< the attitude takes world to body coordinates, not body to world
};

/// The physical quantities of a pose.
enum class PoseQuantity : std::uint8_t { position, attitude, velocity, rate, time };
/// The factor to SI of a unit as DBC files write it, "km" or "deg/s"; an empty one is taken for SI. Nothing: no
/// unit of that quantity.
[[nodiscard]] std::optional<double> si_factor(PoseQuantity quantity, std::string_view unit);
/// The units of a quantity, for messages: "m, km, ...".
[[nodiscard]] std::string units_of(PoseQuantity quantity);

/// Reads the commands of one body. Allocates nothing after it has been made.
class MappedPoseDecoder {
public:
    explicit MappedPoseDecoder(std::shared_ptr<const PoseMap> map);

    /// As MessageDecoder::accept. `counter` of the command counts the commands.
    [[nodiscard]] PoseStatus accept(const CanFrame& frame, std::int64_t t_now_ns, PoseCommand& out) noexcept;
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept {
        return counts_[static_cast<std::size_t>(status)];
    }

private:
    struct Part {
        std::array<std::uint8_t, 64> data{};
        bool come = false;
    };
    [[nodiscard]] PoseStatus take(const CanFrame& frame, std::int64_t t_now_ns, PoseCommand& out) noexcept;
    [[nodiscard]] PoseStatus decode(std::int64_t t_now_ns, PoseCommand& out) const noexcept;
    [[nodiscard]] double number(const MappedNumber& n) const noexcept {
        return n.to_si * n.signal.value(parts_[n.message].data);
    }
    [[nodiscard]] Vec3 vector(const std::array<MappedNumber, 3>& v) const noexcept {
        return {number(v[0]), number(v[1]), number(v[2])};
    }
    [[nodiscard]] std::int64_t time_ns(std::int64_t t_now_ns) const noexcept;

    std::shared_ptr<const PoseMap> map_;
    std::vector<Part> parts_;
    std::uint8_t counter_ = 0;
    std::array<std::uint64_t, kDecodeStatusCount> counts_{};
};

}  // namespace narpa
