/// rehearsal/navigation/leg_path.h - path and speed profile of a leg, from rest to rest or without end.
#pragma once

#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// A straight line or an arc about the origin, with a trapezoidal speed profile (triangular where it is short).
/// Times count from its start; before and after, the position is that of its ends.
class LegPath {
public:
    /// A leg to contact continues in its direction without end.
    static LegPath along(const Leg& leg, const Vec3& from_m, double acceleration_m_s2);
    /// Without end; the speed changes uniformly from `first_m_s`, which may be negative, to `speed_m_s`.
    static LegPath away(const Vec3& from_m, const Vec3& direction, double first_m_s, double speed_m_s,
                        double acceleration_m_s2);

    /// Infinite for a path without end.
    [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
    [[nodiscard]] Vec3 position_m(double t_s) const;
    [[nodiscard]] Vec3 velocity_m_s(double t_s) const;
    [[nodiscard]] Vec3 end_m() const { return at(length_m_); }

private:
    /// Distance along the path, and speed.
    struct Progress {
        double way_m, speed_m_s;
    };
    [[nodiscard]] Progress progress(double t_s) const;
    [[nodiscard]] Vec3 at(double way_m) const;

    Vec3 from_m_{}, direction_{-1, 0, 0};  ///< direction: unit, of a straight path
    Vec3 axis_{};                          ///< of an arc: unit, right-handed
    double radius_m_ = 0;                  ///< > 0: an arc
    double length_m_ = 0, duration_s_ = 0;
    double first_m_s_ = 0, speed_m_s_ = 0, acceleration_m_s2_ = 1;
};

}  // namespace narpa::rehearsal
