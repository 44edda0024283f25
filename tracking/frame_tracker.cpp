#include "tracking/frame_tracker.h"

#include <fmt/format.h>

#include <random>

#include "base/time.h"
#include "emulator/camera/camera_control.h"
#include "estimator/search/pose_search.h"

namespace narpa {

FrameTracker::FrameTracker(const World& world, std::size_t camera, std::size_t target,
                           const TrackerOptions& options)
    : world_(world), camera_(world.scene().cameras[camera]), index_(camera), target_(target), tracker_(options) {
    // The seed is independent of the frames, whose seed may be the same.
    estimator_ = options.method->make(
        world.render_scene(), camera_, target,
        {.seed = ~options.seed, .spp = options.spp, .starts_from_features = true, .model = options.model});
    if (options.search) search_ = std::make_unique<PoseSearch>(world.render_scene(), camera_, target);
}
FrameTracker::~FrameTracker() = default;

Result<std::unique_ptr<FrameTracker>> FrameTracker::create(const World& world, std::size_t camera,
                                                           const TrackerOptions& options) {
    const Camera& c = world.scene().cameras[camera];
    const auto target = target_of(world, c.mount, c.name, options.target);
    if (!target) return target.error();
    if (Status good = check_method(*options.method, world.scene(), *target); !good) return good.error();
    return std::unique_ptr<FrameTracker>(new FrameTracker(world, camera, *target, options));
}

Status set_to_frame(const FrameLedger& ledger, const Camera& as_in_the_scene, Camera& camera) {
    if (!camera.control) return Ok{};
    const CameraSettings taken = settings_of(ledger, as_in_the_scene);
    apply(taken, as_in_the_scene, camera);
    if (taken.binning == 1 && taken.region.width == camera.width && taken.region.height == camera.height)
        return Ok{};
    return Error{fmt::format("{} x {} pixels, binned by {}: expected the whole image, not binned",
                             taken.region.width, taken.region.height, taken.binning)};
}

Status FrameTracker::set(const FrameLedger& ledger) {
    const Status whole = set_to_frame(ledger, world_.scene().cameras[index_], camera_);
    if (!camera_.control) return whole;
    estimator_->set_detector(*camera_.detector);
    if (search_) search_->set_detector(*camera_.detector);
    return whole;
}

ApparentMotion FrameTracker::motion(const FrameLedger& ledger, const BodyPoses& at, const Rigid3& guess) const {
    const double length_s = 1e-9 * static_cast<double>(ledger.t_exposure_end_ns - ledger.t_exposure_start_ns);
    if (!camera_.shutter || !(length_s > 0)) return {};
    const double middle_s = 1e-9 * static_cast<double>(ledger.t_exposure_mid_ns);
    const auto q_frame_chaser = [&](double time) {
        const double t_s = middle_s + (time - kMidExposure) * length_s;
        return (world_.camera_pose(camera_, t_s, at, time) * inverse(T_chaser_camera())).q;
    };
    return tracker_.motion(T_chaser_camera(), guess,
                           {q_frame_chaser(0), q_frame_chaser(kMidExposure), q_frame_chaser(1)}, length_s);
}

TrackedFrame FrameTracker::take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes,
                                const BodyPoses& at) {
    const std::int64_t start_ns = monotonic_ns(), t_ns = ledger.t_exposure_mid_ns;
    TrackedFrame out;
    out.frame = ledger.frame;
    out.t_ns = t_ns;
    const Rigid3 T_world_camera = world_.camera_pose(camera_, 1e-9 * static_cast<double>(t_ns), at);
    out.truth = inverse(T_world_camera) * at.T_world_body[target_];
    const Quat q_frame_chaser = (T_world_camera * inverse(T_chaser_camera())).q;
    tracker_.predict(t_ns, q_frame_chaser);
    if (!searches()) out.guess = tracker_.guess(T_chaser_camera(), q_frame_chaser, out.truth);
    const bool searched = searches();
    const ApparentMotion moving = motion(ledger, at, out.guess);
    const Status usable = set(ledger);
    const Result<MeasuredImage> image =
        usable ? measured_image(camera_, bytes) : Result<MeasuredImage>(usable.error());
    const MeasuredImage none;
    const std::vector<float> variance = frame_variance();
    FrameInput frame{
        .image = image ? *image : none, .at = at, .guess = out.guess, .motion = moving, .variance = variance};
    // Without a truth, the target's attitude in the world, and so its light, is known only by the camera's
    // attitude.
    if (options().guess) frame.T_world_camera = T_world_camera;
    if (image)
        measure(frame, T_world_camera, out);
    else
        out.why = image.error().what;
    tracker_.update(T_chaser_camera(), q_frame_chaser, false, out);
    out.ms = seconds_since(start_ns) * 1e3;
    if (out.measured) {  // after the estimate, and not part of its time
        const Rigid3& there = options().guess ? *out.measured : out.truth;
        const auto bound = searched ? search_->bound(at, T_world_camera, there, dense_options(), variance)
                                    : estimator_->bound(frame, there);
        if (bound) out.bound = *bound;
    }
    return out;
}

bool FrameTracker::searches() const {
    return search_ && !tracker_.started();
}

void FrameTracker::measure(const FrameInput& frame, const Rigid3& T_world_camera, TrackedFrame& out) {
    if (searches()) {
        measure_by_search(frame, T_world_camera, out);
        return;
    }
    const auto e = estimator_->estimate(frame);
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = e->measurements;
    out.renders = e->renders;
    out.take(e->answer, e->T_camera_target, e->covariance, e->covariance_of_model);
}

void FrameTracker::measure_by_search(const FrameInput& frame, const Rigid3& T_world_camera, TrackedFrame& out) {
    SearchOptions o;
    const double most = options().guess ? 0 : o.range_part;
    const double off = std::uniform_real_distribution(-most, most)(tracker_.random());
    o.range_m = options().range_guess_m > 0 ? options().range_guess_m : norm(out.truth.t) / (1 + off);
    o.dense = dense_options();
    const auto e = search_->find(frame.image, frame.at, T_world_camera, o, frame.variance);
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = static_cast<int>(e->pixels);
    out.renders = e->renders;
    out.take(e->answer, e->T_camera_target, e->covariance, e->covariance_of_model);
}

std::vector<float> FrameTracker::frame_variance() const {
    if (!options().frame_noise_dn) return {};
    const int rows = camera_.height - (camera_.embedded_line ? 1 : 0);
    return std::vector<float>(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(rows),
                              static_cast<float>(std::pow(*options().frame_noise_dn, 2)));
}

DenseOptions FrameTracker::dense_options() const {
    DenseOptions dense;
    dense.model = options().model;
    dense.seed = ~options().seed;
    dense.method = world_.scene().render.method;
    dense.max_depth = world_.scene().render.max_depth;
    return dense;
}

}  // namespace narpa
