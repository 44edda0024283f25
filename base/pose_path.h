/// base/pose_path.h - a motion from one pose to another at constant rates: the origin along a straight line,
/// turning about a fixed axis by the shorter way.
#pragma once

#include "base/pose.h"

namespace narpa {

/// Times are fractions of the motion, 0 at its start and 1 at its end.
class PosePath {
public:
    PosePath(const Rigid3& start = {})  // NOLINT(google-explicit-constructor)
        : PosePath(start, start) {}
    PosePath(const Rigid3& start, const Rigid3& end)
        : start_(start), end_(end), near_(dot(start.q, end.q) < 0 ? -end.q : end.q), moves_(!(start == end)) {
        const Quat chord{near_.w - start.q.w, near_.x - start.q.x, near_.y - start.q.y, near_.z - start.q.z};
        const double z = quarter_chord2_ = 0.25 * dot(chord, chord);
        for (double rest = 2 * std::sqrt(z) * z * z; rest > 1e-16; rest *= z) ++terms_;
    }

    [[nodiscard]] bool moves() const noexcept { return moves_; }
    [[nodiscard]] const Rigid3& start() const noexcept { return start_; }
    [[nodiscard]] const Rigid3& end() const noexcept { return end_; }
    /// By which it turns, in [0, pi].
    [[nodiscard]] double angle_rad() const noexcept { return moves_ ? angle_between(start_.q, end_.q) : 0; }

    [[nodiscard]] Vec3 position_at(double time) const noexcept {
        return time == 1 ? end_.t : start_.t + time * (end_.t - start_.t);
    }
    /// Exactly the start pose at 0 and the end pose at 1; between them 1e-15 rad off.
    [[nodiscard]] Rigid3 at(double time) const noexcept {
        return moves_ ? Rigid3{attitude_at(time), position_at(time)} : start_;
    }

    // Slerp's weights, sin(u theta) / sin(theta) with theta the angle between the quaternions, are
    // u F(1 - u, 1 + u; 3/2; chord^2 / 4) (M. Abramowitz, I. Stegun, "Handbook of Mathematical
    // Functions", 15.1.16), a series of positive terms, without the branches of sines.

    /// The end's attitude, with the sign that is nearer to the start's.
    [[nodiscard]] const Quat& near_end() const noexcept { return near_; }
    /// Number of terms after the first.
    [[nodiscard]] int terms() const noexcept { return terms_; }
    /// Factors of the n-th term: weight = u (1 + c_1 (1 - u^2) (1 + c_2 (4 - u^2) (1 + ...))).
    [[nodiscard]] double coefficient(int n) const noexcept { return quarter_chord2_ / (n * (n + 0.5)); }

private:
    [[nodiscard]] double weight(double u) const noexcept {
        double sum = 1;
        for (int n = terms_; n > 0; --n) sum = 1 + coefficient(n) * (n * n - u * u) * sum;
        return u * sum;
    }
    [[nodiscard]] Quat attitude_at(double time) const noexcept {
        if (time == 0) return start_.q;
        if (time == 1) return end_.q;
        const Quat &a = start_.q, &b = near_;
        const double ka = weight(1 - time), kb = weight(time);
        return normalized(Quat{ka * a.w + kb * b.w, ka * a.x + kb * b.x, ka * a.y + kb * b.y, ka * a.z + kb * b.z});
    }

    Rigid3 start_, end_;
    Quat near_;
    double quarter_chord2_ = 0;
    int terms_ = 1;
    bool moves_;
};

}  // namespace narpa
