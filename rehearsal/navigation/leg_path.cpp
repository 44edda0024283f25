#include "rehearsal/navigation/leg_path.h"

#include <algorithm>
#include <cmath>

#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {

LegPath LegPath::along(const Leg& leg, const Vec3& from_m, double acceleration_m_s2) {
    LegPath p;
    p.from_m_ = from_m;
    p.acceleration_m_s2_ = acceleration_m_s2;
    if (leg.arc_deg) {
        p.axis_ = (*leg.arc_deg < 0 ? -1.0 : 1.0) * normalized(leg.axis);
        p.radius_m_ = norm(cross(p.axis_, from_m));
        p.length_m_ = p.radius_m_ * std::abs(*leg.arc_deg) * kDegree;
    } else {
        const Vec3 way = leg.to_m - from_m;
        p.length_m_ = norm(way);
        if (p.length_m_ > 0) p.direction_ = way / p.length_m_;
    }
    if (leg.contact) return away(from_m, p.direction_, 0, leg.speed_m_s, acceleration_m_s2);
    p.speed_m_s_ = std::min(leg.speed_m_s, std::sqrt(p.length_m_ * acceleration_m_s2));
    if (p.length_m_ > 0) p.duration_s_ = p.length_m_ / p.speed_m_s_ + p.speed_m_s_ / acceleration_m_s2;
    return p;
}

LegPath LegPath::away(const Vec3& from_m, const Vec3& direction, double first_m_s, double speed_m_s,
                      double acceleration_m_s2) {
    LegPath p;
    p.from_m_ = from_m;
    p.direction_ = direction;
    p.length_m_ = p.duration_s_ = std::numeric_limits<double>::infinity();
    p.first_m_s_ = first_m_s;
    p.speed_m_s_ = speed_m_s;
    p.acceleration_m_s2_ = std::copysign(acceleration_m_s2, speed_m_s - first_m_s);
    return p;
}

LegPath::Progress LegPath::progress(double t_s) const {
    const double a = acceleration_m_s2_;
    if (t_s <= 0) return {0, first_m_s_};
    if (t_s >= duration_s_) return {length_m_, 0};
    const double faster_s = (speed_m_s_ - first_m_s_) / a;
    if (t_s < faster_s) return {(first_m_s_ + 0.5 * a * t_s) * t_s, first_m_s_ + a * t_s};
    const double left_s = duration_s_ - t_s;
    if (left_s < speed_m_s_ / a) return {length_m_ - 0.5 * a * left_s * left_s, a * left_s};
    return {0.5 * (first_m_s_ + speed_m_s_) * faster_s + speed_m_s_ * (t_s - faster_s), speed_m_s_};
}

Vec3 LegPath::at(double way_m) const {
    if (radius_m_ > 0) return exp_rotation((way_m / radius_m_) * axis_) * from_m_;
    return from_m_ + way_m * direction_;
}

Vec3 LegPath::position_m(double t_s) const {
    return at(progress(t_s).way_m);
}

Vec3 LegPath::velocity_m_s(double t_s) const {
    const Progress p = progress(t_s);
    if (radius_m_ > 0) return (p.speed_m_s / radius_m_) * cross(axis_, at(p.way_m));
    return p.speed_m_s * direction_;
}

}  // namespace narpa::rehearsal
