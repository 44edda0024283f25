/// rehearsal/dynamics/thruster_model.h - forces of the chaser's thrusters for a command: pulses of full force, each
/// with its own error.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "estimator/pose/pose_estimate.h"
#include "protocols/closed_loop.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

enum class Stream : std::uint32_t { start = 1, misalignment, pulses, attitude_sensor };

[[nodiscard]] inline std::mt19937_64 engine(std::uint64_t seed, Stream stream) {
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                           static_cast<std::uint32_t>(stream)};
    return std::mt19937_64(sequence);
}

/// Three draws of unit variance: x, y, z.
[[nodiscard]] inline Vec3 draw_normal(std::mt19937_64& from) {
    std::normal_distribution<double> normal;
    Vec3 v;
    for (int i = 0; i < 3; ++i) v[i] = normal(from);
    return v;
}

/// Force and torque on the chaser, body axes; the torque is about the centre of mass.
struct Loads {
    Vec3 force_n{}, torque_n_m{};
};

/// In the order of kThrusterGroupNames.
inline constexpr int kThrusterGroups = static_cast<int>(kThrusterGroupNames.size());

/// A group fires with its full force or not at all. Each of a command's six impulses is for the group in its
/// direction, which fires for |impulse| / force seconds from the command's time on: not at all if that is less than
/// min_on_s, and for at most the control period. Each pulse has its own error of force, each group one of
/// direction. An engine in place of a group burns for the whole period with the force impulse / period, within its
/// limits; it is off if the impulse is 0.
class ThrusterModel {
public:
    ThrusterModel(const Scenario& scenario, std::uint64_t seed);

    /// Replaces the rest of an earlier command.
    void fire(const ActuatorCommand& command, std::int64_t t_ns);
    /// Constant from t_ns to next_change_ns(t_ns).
    [[nodiscard]] Loads loads(std::int64_t t_ns) const;
    /// The next end of a pulse, start or end of a fault.
    [[nodiscard]] std::int64_t next_change_ns(std::int64_t t_ns) const;

    /// Each group's direction with its error, body axes.
    [[nodiscard]] const std::array<Vec3, kThrusterGroups>& directions() const noexcept { return directions_; }

private:
    struct Pulse {
        std::int64_t from_ns = 0, until_ns = 0;
        double strength = 0;  ///< N, or N m
    };
    [[nodiscard]] double full(int group) const noexcept;
    [[nodiscard]] double strength(int group, std::int64_t t_ns, const FaultEffects& faults) const;
    void fire(int group, double impulse, std::int64_t t_ns);
    void burn(double impulse, std::int64_t t_ns);

    Thrusters thrusters_;
    std::optional<Engine> engine_;
    std::int64_t period_ns_;
    std::vector<Fault> faults_;
    std::mt19937_64 gains_;
    std::array<Vec3, kThrusterGroups> directions_{};
    std::array<Pulse, kThrusterGroups> pulses_{};
};

}  // namespace narpa::rehearsal
