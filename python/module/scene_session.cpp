#include "python/module/scene_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/text/nearest_name.h"

namespace narpa::python {

Result<std::int64_t> to_ns(double time_s) {
    if (!(std::abs(time_s) <= 9e9)) return Error{fmt::format("time {} s, expected -9e9 to 9e9", time_s)};
    return static_cast<std::int64_t>(std::llround(time_s * 1e9));
}

Result<std::unique_ptr<SceneSession>> SceneSession::create(Scene scene, int threads) {
    auto world = World::create(std::move(scene));
    if (!world) return world.error();
    return std::unique_ptr<SceneSession>(new SceneSession(*std::move(world), threads));
}

SceneSession::SceneSession(std::unique_ptr<World> world, int threads)
    : threads_(threads), world_(std::move(world)), settings_(world_->scene().render) {}

Result<std::size_t> SceneSession::body_of(const std::string& name) const {
    if (const auto found = world_->body_named(name)) return *found;
    std::vector<std::string> names;
    for (const Body& b : scene().bodies) names.push_back(b.name);
    return Error{fmt::format("no body named \"{}\", expected one of {}{}", name, fmt::join(names, ", "),
                             did_you_mean(name, names)),
                 scene().file};
}

Status SceneSession::place(const std::string& name, const Motion& motion) {
    const std::scoped_lock lock(mutex_);
    const auto body = body_of(name);
    if (!body) return body.error();
    world_->set_motion(*body, motion);
    return Ok{};
}

Status SceneSession::place_camera(const std::string& name, const std::string& mount, const Rigid3& T_mount_camera) {
    const std::scoped_lock lock(mutex_);
    const auto camera = sensor_named(scene().cameras, name, "camera", scene().file);
    if (!camera) return camera.error();
    int body = -1;
    if (!mount.empty()) {
        const auto found = body_of(mount);
        if (!found) return found.error();
        body = static_cast<int>(*found);
    }
    world_->set_mount(*camera, body, T_mount_camera);
    unit_of(*camera).set_mount(body, T_mount_camera);
    return Ok{};
}

Result<Rigid3> SceneSession::T_world_body(const std::string& name, double time_s) {
    const std::scoped_lock lock(mutex_);
    const auto body = body_of(name);
    if (!body) return body.error();
    const auto t_ns = to_ns(time_s);
    if (!t_ns) return t_ns.error();
    BodyPoses at(scene().bodies.size());
    world_->place(*t_ns, -1, at);
    return at.T_world_body[*body];
}

Result<Rigid3> SceneSession::T_world_camera(const std::string& name, double time_s) {
    const std::scoped_lock lock(mutex_);
    const auto camera = sensor_named(scene().cameras, name, "camera", scene().file);
    if (!camera) return camera.error();
    const auto t_ns = to_ns(time_s);
    if (!t_ns) return t_ns.error();
    BodyPoses at(scene().bodies.size());
    world_->place(*t_ns, -1, at);
    return world_->camera_pose(scene().cameras[*camera], time_s, at);
}

CameraUnit& SceneSession::unit_of(std::size_t camera) {
    auto& unit = cameras_[camera];
    if (!unit) unit = std::make_unique<CameraUnit>(*world_, camera);
    return *unit;
}

Result<RenderedImage> SceneSession::render(const RenderRequest& r) {
    const std::scoped_lock lock(mutex_);
    const auto index = sensor_named(scene().cameras, r.camera, "camera", scene().file);
    if (!index) return index.error();
    const auto t_ns = to_ns(r.time_s);
    if (!t_ns) return t_ns.error();
    if (r.spp && (*r.spp < 1 || *r.spp > 65535)) return Error{fmt::format("spp {}, expected 1 to 65535", *r.spp)};
    RenderSettings settings = settings_;
    settings.seed = r.seed.value_or(settings.seed);
    if (r.spp) {
        settings.spp = *r.spp;
        settings.keep_deadline = false;
        settings.budget_ns = 0, settings.budget_rays = 0;
    }
    world_->set_render(settings);
    const bool is_new = !cameras_.contains(*index);
    CameraUnit& unit = unit_of(*index);
    const std::int64_t period_ns = unit.camera().period_ns;
    const auto nearest = static_cast<std::uint32_t>(std::max<std::int64_t>(0, (*t_ns + period_ns / 2) / period_ns));
    const std::uint32_t frame = r.frame.value_or(nearest);

    RenderedImage out;
    const auto expose = [&](Aovs* aovs) {
        threads_.arena.execute([&] {
            const std::int64_t budget_ns = settings.budget_ns;
            out.ledger = unit.expose(frame, *t_ns, budget_ns > 0 ? monotonic_ns() + budget_ns : 0, aovs);
            unit.embed(out.ledger);
            if (budget_ns > 0) unit.handed_over(monotonic_ns());
        });
    };
    if (is_new && settings.budget_ns > 0) expose(nullptr);  // calibrates the renderer
    expose(r.with_aovs ? &out.aovs : nullptr);
    out.camera = unit.camera();
    // Copies, because the renderer updates its buffer from frame to frame.
    out.radiance = unit.radiance().pixels;
    out.bytes.assign(unit.bytes().begin(), unit.bytes().end());
    return out;
}

Result<std::vector<ShotRow>> SceneSession::scan(const std::string& name, double time_s, double duration_s) {
    const std::scoped_lock lock(mutex_);
    const auto index = sensor_named(scene().lidars, name, "LiDAR", scene().file);
    if (!index) return index.error();
    if (!(time_s >= 0 && time_s <= 9e9)) return Error{fmt::format("time {} s, expected 0 to 9e9", time_s)};
    if (!(duration_s >= 0 && duration_s <= 3600))
        return Error{fmt::format("duration {} s, expected 0 (one turn) to 3600", duration_s)};
    auto& unit = lidars_[*index];
    if (!unit) unit = std::make_unique<LidarUnit>(*world_, *index, true);
    const std::int64_t from_ns = std::llround(time_s * 1e9);
    const std::int64_t to_ns =
        from_ns + std::llround(1e9 * (duration_s > 0 ? duration_s : 1 / unit->spec().rate_hz));
    std::vector<ShotRow> rows;
    threads_.arena.execute([&] {
        for (std::int64_t p = unit->first_packet_from(from_ns); unit->packet_start_ns(p) < to_ns; ++p) {
            unit->fire(p);
            for (std::size_t i = 0; i < unit->shots().size(); ++i) rows.push_back(shot_row(*unit, p, i));
        }
    });
    return rows;
}

}  // namespace narpa::python
