/// rehearsal/navigation/leg_path.h - a way through space, from rest to rest or on and on.
#pragma once

#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Along a straight line or an arc about the origin, with a speed that grows and falls evenly (a trapezoid; a
/// triangle where the way is short). Times count from its beginning; before it stands at its first point, after
/// it at its last.
class LegPath {
public:
    /// `leg`: where to, how fast; a leg to contact goes on in its direction without an end.
    static LegPath along(const Leg& leg, const Vec3& from_m, double acceleration_m_s2);
    /// Without an end; the speed goes evenly from `first_m_s`, which may be negative, to `speed_m_s`.
    static LegPath away(const Vec3& from_m, const Vec3& direction, double first_m_s, double speed_m_s,
                        double acceleration_m_s2);

    /// Infinite for a way without an end.
    [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
    [[nodiscard]] Vec3 position_m(double t_s) const;
    [[nodiscard]] Vec3 velocity_m_s(double t_s) const;
    [[nodiscard]] Vec3 end_m() const { return at(length_m_); }

private:
    /// Way and speed at a time.
    struct Progress {
        double way_m, speed_m_s;
    };
    [[nodiscard]] Progress progress(double t_s) const;
    [[nodiscard]] Vec3 at(double way_m) const;

    Vec3 from_m_{}, direction_{-1, 0, 0};  ///< direction: unit, of a straight way; of none: into the port
    Vec3 axis_{};                          ///< of an arc: unit, turning as the way goes
    double radius_m_ = 0;                  ///< > 0: an arc
    double length_m_ = 0, duration_s_ = 0;
    double first_m_s_ = 0, speed_m_s_ = 0, acceleration_m_s2_ = 1;
};

}  // namespace narpa::rehearsal
