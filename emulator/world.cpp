#include "emulator/world.h"

#include <fmt/format.h>

#include <cassert>
#include <unordered_map>
#include <utility>

#include "protocols/video/embedded_line.h"
#include "renderer/light/air_for_lidar.h"

namespace narpa {

namespace {

/// An Error if the camera's rows are too narrow for its embedded line.
Status check_camera(const Camera& c, const std::string& file) {
    const std::size_t row = link_row_bytes(c.video_format());
    if (c.embedded_line && row < kEmbeddedLineBytes)
        return Error{fmt::format("camera \"{}\": rows of {} bytes, expected at least {} for embedded_line", c.name,
                                 row, kEmbeddedLineBytes),
                     file};
    return Ok{};
}

}  // namespace

Result<std::unique_ptr<World>> World::create(Scene scene) {
    return create(std::move(scene), false);
}

Result<std::unique_ptr<World>> World::create_for_lidars(Scene scene) {
    return create(std::move(scene), true);
}

Result<std::unique_ptr<World>> World::create(Scene scene, bool for_lidars) {
    for (const Camera& c : scene.cameras)
        if (auto good = check_camera(c, scene.file); !good) return good.error();
    std::unique_ptr<World> world(new World);
    world->scene_ = std::move(scene);
    auto render_scene =
        RenderScene::create(world->scene_, 0, nullptr,
                            for_lidars && world->scene_.atmosphere ? air_for_lidars_alone(world->scene_) : nullptr);
    if (!render_scene) return render_scene.error();
    world->render_scene_.emplace(*std::move(render_scene));

    const std::vector<Body>& bodies = world->scene_.bodies;
    world->tracks_.resize(bodies.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i].can_id) continue;
        world->tracks_[i] = std::make_unique<PoseTrack>(bodies[i].initial, world->scene_.render.stale_after_s);
        ++world->commanded_;
    }
    world->find_moving();
    return world;
}

void World::find_moving() {
    moving_.clear();
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
        const Motion& m = scene_.bodies[i].initial;
        if (tracks_[i] || scene_.bodies[i].course || m.velocity_m_s != Vec3{} || m.rate_rad_s != Vec3{})
            moving_.push_back(i);
    }
}

void World::restart() noexcept {
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        if (tracks_[i]) tracks_[i]->restart(scene_.bodies[i].initial);
}

void World::set_motion(std::size_t body, const Motion& motion) {
    assert(body < scene_.bodies.size());
    scene_.bodies[body].initial = motion;
    scene_.bodies[body].course = nullptr;
    if (tracks_[body]) tracks_[body]->restart(motion);
    find_moving();
}

void World::set_mount(std::size_t camera, int mount, const Rigid3& T_mount_camera) {
    assert(camera < scene_.cameras.size() && mount < static_cast<int>(scene_.bodies.size()));
    Camera& c = scene_.cameras[camera];
    c.mount = mount;
    c.T_mount_camera = T_mount_camera;
    c.course = nullptr;
}

Status World::load(const std::vector<TrajectoryRow>& rows, std::int64_t t_from_ns, std::int64_t t_to_ns) {
    std::vector<const TrajectoryRow*> before(scene_.bodies.size(), nullptr);
    std::vector<bool> past_end(scene_.bodies.size(), false), is_new(scene_.bodies.size(), false);
    const auto take = [&](std::size_t body, const TrajectoryRow& row) {
        if (!is_new[body])
            tracks_[body] = std::make_unique<PoseTrack>(scene_.bodies[body].initial, scene_.render.stale_after_s);
        is_new[body] = true;
        return tracks_[body]->push({0, row.t_ns, row.motion}, t_from_ns) == TrackStatus::taken;
    };
    std::unordered_map<std::string_view, std::size_t> index;
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) index.emplace(scene_.bodies[i].name, i);
    for (const TrajectoryRow& row : rows) {
        const auto body = index.find(row.body);
        if (body == index.end())
            return Error{"the trajectory names a body \"" + row.body + "\" that the scene does not have",
                         scene_.file};
        const std::size_t i = body->second;
        if (row.t_ns <= t_from_ns) {
            before[i] = &row;
        } else if (!past_end[i]) {
            if (before[i]) take(i, *std::exchange(before[i], nullptr));
            if (!take(i, row)) return Error{"the trajectory has too many rows for this span", scene_.file};
            past_end[i] = row.t_ns >= t_to_ns;
        }
    }
    for (std::size_t i = 0; i < before.size(); ++i)
        if (before[i]) take(i, *before[i]);
    find_moving();
    return Ok{};
}

TrackedPose World::pose(std::size_t body, std::int64_t t_ns) const noexcept {
    assert(body < tracks_.size());
    if (tracks_[body]) return tracks_[body]->at(t_ns);
    return {motion_at(scene_.bodies[body], static_cast<double>(t_ns) * 1e-9), 0, 0, false, false};
}

PlacementSource World::place(std::int64_t t_ns, int rider, BodyPoses& out,
                             std::span<Motion> motions) const noexcept {
    assert(out.T_world_body.size() == scene_.bodies.size() && rider < static_cast<int>(scene_.bodies.size()));
    PlacementSource source;
    bool named = false;
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
        const TrackedPose p = pose(i, t_ns);
        out.set(i, p.motion.T_world_body);
        if (i < motions.size()) motions[i] = p.motion;
        source.stale |= p.stale;
        if (p.commanded && (!named || static_cast<int>(i) == rider)) {
            source.counter = p.counter;
            source.t_pose_ns = p.t_pose_ns;
            named = true;
        }
    }
    tracer().arrange(out);
    return source;
}

void World::place_moving(std::int64_t start_ns, std::int64_t end_ns, BodyPoses& out) const noexcept {
    assert(start_ns <= end_ns);
    for (const std::size_t i : moving_)
        out.set(i, pose(i, start_ns).motion.T_world_body, pose(i, end_ns).motion.T_world_body);
    tracer().arrange(out);
}

std::optional<std::size_t> World::body_named(std::string_view name) const noexcept {
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i)
        if (scene_.bodies[i].name == name) return i;
    return std::nullopt;
}

}  // namespace narpa
