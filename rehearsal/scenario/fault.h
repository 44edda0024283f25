/// rehearsal/scenario/fault.h - faults of a scenario. A kind of fault is a row of fault_kinds(): reader, dynamics,
/// report and documents know no kind by name.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>

#include "base/pose.h"

namespace narpa::rehearsal {

inline constexpr std::array<std::string_view, 12> kThrusterGroupNames{"+fx", "-fx", "+fy", "-fy", "+fz", "-fz",
                                                                      "+tx", "-tx", "+ty", "-ty", "+tz", "-tz"};

/// Nanoseconds of a scenario's seconds; infinity becomes the largest value.
[[nodiscard]] inline std::int64_t to_ns(double t_s) {
    constexpr double kEnd = 9.2e18;
    return t_s * 1e9 < kEnd ? std::llround(t_s * 1e9) : std::numeric_limits<std::int64_t>::max();
}

/// What the faults of one moment do to the two bodies.
struct FaultEffects {
    std::array<bool, kThrusterGroupNames.size()> off{},
        stuck{};                  ///< thruster groups: never fire; fire all the time
    bool throttle_stuck = false;  ///< the engine burns with its least force whenever it burns
    bool commands_lost = false;   ///< no actuator command is delivered
    Quat q_attitude_bias{};       ///< of the attitude sensor, chaser's body axes
    Vec3 target_rate_rad_s{};     ///< change of the target's rate, its body axes
};

struct Fault;
struct FaultKind {
    std::string_view name;   ///< `kind` in scenario files
    std::string_view key;    ///< its own key: "axis" (a group of thrusters), "value" (a vector), or empty
    std::string_view title;  ///< in reports; an axis follows
    std::string_view text;   ///< what it does, for documents
    bool needs_engine;
    void (*act)(const Fault&, FaultEffects&);  ///< while it lasts
};
[[nodiscard]] std::span<const FaultKind> fault_kinds();
/// Null: there is no such kind.
[[nodiscard]] const FaultKind* fault_kind(std::string_view name);

struct Fault {
    const FaultKind* kind = nullptr;
    double from_s = 0, until_s = std::numeric_limits<double>::infinity();
    std::string axis;  ///< "+fx", "-fz", "+tx" ...: force or torque, chaser's body axes
    Vec3 value{};      ///< deg or deg/s, body axes

    [[nodiscard]] std::size_t group() const;  ///< index of `axis` in kThrusterGroupNames
};

/// At the scenario's time t_ns: a fault acts from `from_s` up to, not including, `until_s`.
[[nodiscard]] FaultEffects effects_at(std::span<const Fault> faults, std::int64_t t_ns);
/// The next start or end of a fault after t_ns; the largest time if there is none.
[[nodiscard]] std::int64_t next_change_ns(std::span<const Fault> faults, std::int64_t t_ns);

}  // namespace narpa::rehearsal
