#include "tracking/stereo_tracker.h"

#include <fmt/format.h>

#include <cstdlib>
#include <utility>

#include "base/time.h"
#include "tracking/frame_tracker.h"

namespace narpa {
namespace {

std::string place_of_camera(const Scene& scene, const Camera& camera) {
    if (camera.mount < 0) return fmt::format("\"{}\" in the world", camera.name);
    return fmt::format("\"{}\" on \"{}\"", camera.name, scene.bodies[static_cast<std::size_t>(camera.mount)].name);
}

}  // namespace

Status check_stereo(const World& world, std::size_t left, std::size_t right) {
    const Scene& scene = world.scene();
    const Camera &l = scene.cameras[left], &r = scene.cameras[right];
    if (left == right)
        return Error{fmt::format("\"{0}\" and \"{0}\" are one camera, expected two for stereo", l.name),
                     scene.file};
    if (l.mount != r.mount)
        return Error{fmt::format("cameras {} and {}: expected two on one body for stereo",
                                 place_of_camera(scene, l), place_of_camera(scene, r)),
                     scene.file};
    if (!(norm(l.T_mount_camera.t - r.T_mount_camera.t) > 0))
        return Error{fmt::format("cameras \"{}\" and \"{}\" are at one place, expected a baseline for stereo",
                                 l.name, r.name),
                     scene.file};
    for (const Camera* c : {&l, &r})
        if (c->shutter)
            return Error{
                fmt::format("camera \"{}\" has a rolling shutter, expected a global one for stereo", c->name),
                scene.file};
    return Ok{};
}

Result<StereoImages> stereo_images(const World& world, std::size_t left_camera, std::size_t right_camera,
                                   const TakenFrame& left, const TakenFrame& right, const BodyPoses& at) {
    const Scene& scene = world.scene();
    const std::int64_t t_ns = left.ledger.t_exposure_mid_ns;
    StereoImages out;
    if (std::abs(right.ledger.t_exposure_mid_ns - t_ns) > kSimultaneous_ns)
        return Error{fmt::format("exposures at {:.6f} and {:.6f} s, expected the same time",
                                 1e-9 * static_cast<double>(t_ns),
                                 1e-9 * static_cast<double>(right.ledger.t_exposure_mid_ns))};
    const auto take = [&](const TakenFrame& taken, std::size_t index, Camera& camera,
                          MeasuredImage& image) -> Status {
        camera = scene.cameras[index];
        if (Status whole = set_to_frame(taken.ledger, scene.cameras[index], camera); !whole)
            return Error{fmt::format("camera \"{}\": {}", camera.name, whole.error().what)};
        auto read = measured_image(camera, taken.bytes);
        if (!read) return read.error();
        image = *std::move(read);
        return Ok{};
    };
    if (Status good = take(left, left_camera, out.pair.left, out.left); !good) return good.error();
    if (Status good = take(right, right_camera, out.pair.right, out.right); !good) return good.error();
    const double t_s = 1e-9 * static_cast<double>(t_ns);
    out.pair.T_right_left =
        inverse(world.camera_pose(out.pair.right, t_s, at)) * world.camera_pose(out.pair.left, t_s, at);
    return out;
}

StereoTracker::StereoTracker(const World& world, std::size_t left, std::size_t right, std::size_t target,
                             const TrackerOptions& options)
    : world_(world),
      left_(left),
      right_(right),
      target_(target),
      tracker_(options),
      alignment_(world.tracer(), target, {.model = options.model}) {}

Result<std::unique_ptr<StereoTracker>> StereoTracker::create(const World& world, std::size_t left,
                                                             std::size_t right, const TrackerOptions& options) {
    if (Status good = check_stereo(world, left, right); !good) return good.error();
    const Camera& c = world.scene().cameras[left];
    const auto target = target_of(world, c.mount, c.name, options.target);
    if (!target) return target.error();
    if (options.search) return Error{"stereo starts from a guess, expected --start DEG,PERCENT"};
    return std::unique_ptr<StereoTracker>(new StereoTracker(world, left, right, *target, options));
}

Rigid3 StereoTracker::T_chaser_camera() const {
    const Camera& c = world_.scene().cameras[left_];
    return c.mount < 0 ? Rigid3{} : c.T_mount_camera;
}

TrackedFrame StereoTracker::take(const TakenFrame& left, const TakenFrame& right, const BodyPoses& at) {
    const std::int64_t start_ns = monotonic_ns(), t_ns = left.ledger.t_exposure_mid_ns;
    TrackedFrame out;
    out.frame = left.ledger.frame;
    out.t_ns = t_ns;
    const Camera& camera = world_.scene().cameras[left_];
    const Rigid3 T_world_camera = world_.camera_pose(camera, 1e-9 * static_cast<double>(t_ns), at);
    out.truth = inverse(T_world_camera) * at.T_world_body[target_];
    const Quat q_frame_chaser = (T_world_camera * inverse(T_chaser_camera())).q;
    tracker_.predict(t_ns, q_frame_chaser);
    out.guess = tracker_.guess(T_chaser_camera(), q_frame_chaser, out.truth);
    images_.reset();
    if (auto images = stereo_images(world_, left_, right_, left, right, at)) {
        images_ = *std::move(images);
        measure(q_frame_chaser, out);
    } else {
        out.why = images.error().what;
    }
    tracker_.update(T_chaser_camera(), q_frame_chaser, true, out);
    out.ms = seconds_since(start_ns) * 1e3;
    return out;
}

void StereoTracker::measure(const Quat& q_frame_chaser, TrackedFrame& out) {
    const double reach_m = world_.tracer().bounding_radius_m(static_cast<std::uint32_t>(target_));
    const auto e = alignment_.align(images_->pair, images_->left, images_->right, out.guess,
                                    tracker_.search_radius_m(norm(out.guess.t), reach_m),
                                    tracker_.guess_covariance(T_chaser_camera(), q_frame_chaser, out.guess));
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = static_cast<int>(e->pose.used);
    out.bound = e->pose.bound;
    out.take(e->pose.answer, e->pose.T_lidar_target, e->pose.covariance, e->pose.covariance_of_model);
}

}  // namespace narpa
