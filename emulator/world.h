/// emulator/world.h - a scene with its tracer and the pose tracks of its commanded bodies.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/pose_track.h"
#include "renderer/light/render_scene.h"
#include "renderer/scene/scene.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa {

/// The command that a placement is based on, for the ledger.
struct PlacementSource {
    std::uint8_t counter = 0;
    std::int64_t t_pose_ns = 0;  ///< 0: no command
    bool stale = false;          ///< a commanded body had no command, or none for longer than stale_after_s
};

class World {
public:
    /// Builds the tracer and the tracks.
    static Result<std::unique_ptr<World>> create(Scene scene);
    /// The same for LiDARs alone: air is that at their wavelength, without the tables that images need.
    static Result<std::unique_ptr<World>> create_for_lidars(Scene scene);

    [[nodiscard]] const Scene& scene() const noexcept { return scene_; }
    [[nodiscard]] const RenderScene& render_scene() const noexcept { return *render_scene_; }
    [[nodiscard]] const Tracer& tracer() const noexcept { return render_scene_->tracer(); }
    /// The track of body i; null when the scene gives it no can_id.
    [[nodiscard]] PoseTrack* track(std::size_t body) noexcept { return tracks_[body].get(); }
    [[nodiscard]] const PoseTrack* track(std::size_t body) const noexcept { return tracks_[body].get(); }
    [[nodiscard]] bool has_commanded_bodies() const noexcept { return commanded_ > 0; }

    /// For a single image or scan: takes the rows of a trajectory that matter between two times as commands.
    /// Other bodies keep the scene's own motion. A later call replaces the commands of the bodies that it names.
    Status load(const std::vector<TrajectoryRow>& rows, std::int64_t t_from_ns, std::int64_t t_to_ns);

    // Changes of the scene between frames, while no other thread uses the world.

    /// Forgets all commands.
    void restart() noexcept;

    /// The body's motion from time 0 on, in place of its own, its course and its commands.
    void set_motion(std::size_t body, const Motion& motion);
    /// Where a camera is from now on: on a body, or on the world (-1). For later units; CameraUnit::set_mount.
    void set_mount(std::size_t camera, int mount, const Rigid3& T_mount_camera);
    /// Settings of later frames.
    void set_render(const RenderSettings& settings) noexcept { scene_.render = settings; }

    /// Computes every body's pose at t. `rider`: the body whose command the returned source names, if it has one (a
    /// sensor's mount); -1 for none. `motions`: receives the bodies' motions, up to its length; a later call may
    /// use newer commands. Allocates nothing.
    PlacementSource place(std::int64_t t_ns, int rider, BodyPoses& out,
                          std::span<Motion> motions = {}) const noexcept;
    /// Moves the bodies that can move (all but those at rest without a can_id) from their pose at the start to the
    /// one at the end, after a first `place`.
    void place_moving(std::int64_t start_ns, std::int64_t end_ns, BodyPoses& out) const noexcept;

    [[nodiscard]] Rigid3 sensor_pose(int mount, const Rigid3& T_mount_sensor, const BodyPoses& at,
                                     double time = kMidExposure) const noexcept {
        return mount < 0 ? T_mount_sensor
                         : at.T_world_body_at(static_cast<std::size_t>(mount), time) * T_mount_sensor;
    }
    /// `t_s`: simulation time of that moment of the exposure, for a camera with a course of its own.
    [[nodiscard]] Rigid3 camera_pose(const Camera& camera, double t_s, const BodyPoses& at,
                                     double time = kMidExposure) const noexcept {
        return camera.course ? camera.course->at(t_s).T_world_body
                             : sensor_pose(camera.mount, camera.T_mount_camera, at, time);
    }
    [[nodiscard]] std::optional<std::size_t> body_named(std::string_view name) const noexcept;

private:
    World() = default;
    static Result<std::unique_ptr<World>> create(Scene scene, bool for_lidars);
    void find_moving();
    [[nodiscard]] TrackedPose pose(std::size_t body, std::int64_t t_ns) const noexcept;

    Scene scene_;
    std::optional<RenderScene> render_scene_;
    std::vector<std::unique_ptr<PoseTrack>> tracks_;
    std::vector<std::size_t> moving_;
    std::size_t commanded_ = 0;
};

/// The index of a camera or LiDAR by name ("" is the first); an Error that lists the names there are.
template <class Sensor>
Result<std::size_t> sensor_named(const std::vector<Sensor>& sensors, std::string_view name, std::string_view kind,
                                 const std::string& file) {
    if (sensors.empty()) return Error{"the scene has no " + std::string(kind), file};
    if (name.empty()) return std::size_t{0};
    std::string names;
    for (std::size_t i = 0; i < sensors.size(); ++i) {
        if (sensors[i].name == name) return i;
        names += (i ? ", " : "") + sensors[i].name;
    }
    return Error{"no " + std::string(kind) + " named \"" + std::string(name) + "\", expected one of: " + names,
                 file};
}

}  // namespace narpa
