/// base/camera_pose.h - where the camera is at each moment of an exposure, and when each row is exposed.
///
/// Times are fractions of the exposure of the whole image, as in BodyPoses: 0 where its first row begins, 1 where
/// its last row ends.
#pragma once

#include "base/pose_path.h"

namespace narpa {

class CameraPose {
public:
    /// A picture of one moment: all rays are taken at mid-exposure, from here.
    CameraPose(const Rigid3& T_world_camera = {})  // NOLINT(google-explicit-constructor)
        : path_(T_world_camera), middle_(T_world_camera) {}
    /// A picture taken over time, also of bodies that move. The camera's centre moves along a straight line and the
    /// camera turns about a fixed axis, both at constant rates. `row_time` is the time from the start of one row's
    /// exposure to the start of the next: 0 for a global shutter, above that a rolling shutter, at most
    /// 1 / (rows - 1), where each row is exposed for a moment only.
    CameraPose(const Rigid3& start, const Rigid3& end, double row_time = 0)
        : path_(start, end), middle_(path_.at(0.5)), row_time_(row_time), over_time_(true) {}

    /// When the exposure begins and ends on the simulation clock, and the camera's velocity in the world, for
    /// stars: they turn with the clock, and are displaced by aberration. 0 where not set.
    void set_clock(double start_s, double end_s, const Vec3& velocity_m_s) {
        start_s_ = start_s, end_s_ = end_s, velocity_m_s_ = velocity_m_s;
    }
    [[nodiscard]] double seconds(double time) const noexcept { return start_s_ + time * (end_s_ - start_s_); }
    [[nodiscard]] const Vec3& velocity_m_s() const noexcept { return velocity_m_s_; }

    [[nodiscard]] bool over_time() const noexcept { return over_time_; }
    [[nodiscard]] bool moves() const noexcept { return path_.moves(); }
    [[nodiscard]] const PosePath& path() const noexcept { return path_; }
    [[nodiscard]] Rigid3 at(double time) const noexcept { return path_.at(time); }
    /// At mid-exposure.
    [[nodiscard]] const Rigid3& middle() const noexcept { return middle_; }

    /// When a ray of this row is taken. `u` in [0, 1): its place within the exposure of the row.
    [[nodiscard]] double time(double row, int rows, double u) const noexcept {
        return row * row_time_ + u * (1 - (rows - 1) * row_time_);
    }

private:
    PosePath path_;
    Rigid3 middle_;
    double row_time_ = 0;
    double start_s_ = 0, end_s_ = 0;
    Vec3 velocity_m_s_{};
    bool over_time_ = false;
};

}  // namespace narpa
