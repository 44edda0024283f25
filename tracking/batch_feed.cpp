#include "tracking/batch_feed.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "estimator/batch/camera_change.h"

namespace narpa {
namespace {

/// Time over which the chaser's rate is measured.
constexpr std::int64_t kRateStep_ns = 1'000'000;

BatchTime time_of(const ChaserSample& s, const ChaserSample& later) {
    const Quat turn = conjugate(s.T_world_chaser.q) * later.T_world_chaser.q;
    const double dt_s = 1e-9 * static_cast<double>(later.t_ns - s.t_ns);
    return {s.t_ns, s.T_world_chaser.q, dt_s > 0 ? rotation_vector(turn) / dt_s : Vec3{},
            inverse(s.T_world_chaser) * s.T_world_target};
}

Rigid3 between(const Rigid3& a, const Rigid3& b, double u) {
    return {slerp(a.q, b.q, u), (1 - u) * a.t + u * b.t};
}

}  // namespace

ChaserSample ChaserPath::between(std::int64_t t_ns) const {
    if (samples_.size() < 2) return samples_.front();
    auto after = std::ranges::upper_bound(samples_, t_ns, {}, &ChaserSample::t_ns);
    after = std::clamp(after, samples_.begin() + 1, samples_.end() - 1);
    const ChaserSample &a = *(after - 1), &b = *after;
    if (a.t_ns == t_ns || b.t_ns == a.t_ns) return a;
    const double u = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
    return {t_ns, narpa::between(a.T_world_chaser, b.T_world_chaser, u),
            narpa::between(a.T_world_target, b.T_world_target, u)};
}

BatchTime ChaserPath::at(std::int64_t t_ns) const {
    return time_of(between(t_ns), between(t_ns + kRateStep_ns));
}

Result<std::unique_ptr<BatchFrameFeed>> BatchFrameFeed::create(const World& model, std::size_t camera,
                                                               const TrackerOptions& options, bool keeps_frames) {
    auto tracker = FrameTracker::create(model, camera, options);
    if (!tracker) return tracker.error();
    return std::unique_ptr<BatchFrameFeed>(new BatchFrameFeed(model, camera, *std::move(tracker), keeps_frames));
}

void BatchFrameFeed::pass(const FrameLedger& ledger, const World& truth, const BodyPoses& at) {
    const Camera& c = truth.scene().cameras[camera_];
    const std::int64_t t_ns = ledger.t_exposure_mid_ns;
    const Rigid3 T_chaser_camera = c.mount < 0 ? Rigid3{} : c.T_mount_camera;
    path_.add({t_ns, truth.camera_pose(c, 1e-9 * static_cast<double>(t_ns), at) * inverse(T_chaser_camera),
               at.T_world_body[tracker_->target()]});
}

void BatchFrameFeed::take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const World& truth,
                          const BodyPoses& at, std::int64_t stamp_late_ns) {
    pass(ledger, truth, at);
    TrackedFrame f = tracker_->take(ledger, bytes, at);
    if (const PointObservations* points = tracker_->points(); points && f.measured) {
        frames_.push_back({{.t_ns = f.t_ns + stamp_late_ns}, *f.measured, *points, {}});
        if (keeps_frames_) kept_.push_back({ledger, {bytes.begin(), bytes.end()}, at});
    }
    tracked_.push_back(std::move(f));
}

/// A distortion before that of a projection without OpenCV's cannot be rendered, and is left out.
std::shared_ptr<const CameraModel> BatchFrameFeed::corrected(const CameraModel& model, BatchValues change) {
    auto changed = changed_camera(model, change);
    if (changed) return *std::move(changed);
    for (const BatchUnknown u :
         {BatchUnknown::k1, BatchUnknown::k2, BatchUnknown::p1, BatchUnknown::p2, BatchUnknown::k3})
        at(change, u) = 0;
    changed = changed_camera(model, change);
    return changed ? *std::move(changed) : nullptr;
}

void BatchFrameFeed::observe_brightness(const BatchResult& found, BatchInput& input) const {
    BatchValues change{};
    for (const BatchEstimate& e : found.unknowns) at(change, e.unknown) = e.value;
    const Camera& in_the_scene = model_.scene().cameras[camera_];
    const auto lens = corrected(*in_the_scene.model, change);
    if (!lens) return;
    Rigid3 T_chaser_camera = input.T_chaser_camera;
    T_chaser_camera.q = normalized(T_chaser_camera.q * exp_rotation(vector_at(change, BatchUnknown::camera_rx)));
    T_chaser_camera.t = T_chaser_camera.t + vector_at(change, BatchUnknown::camera_x);
    const RenderSettings& render = model_.scene().render;
    FrameSettings settings;
    settings.spp = tracker_->options().spp, settings.seed = ~tracker_->options().seed;
    settings.method = render.method, settings.max_depth = render.max_depth;
    for (std::size_t i = 0; i < kept_.size(); ++i) {
        BatchFrame& frame = input.frames[i];
        Camera camera = in_the_scene;
        if (!set_to_frame(kept_[i].ledger, in_the_scene, camera)) continue;
        const auto image = measured_image(camera, kept_[i].bytes);
        if (!image) continue;
        camera.model = lens;
        auto state = std::ranges::upper_bound(found.states, frame.time.t_ns, {}, &BatchState::t_ns);
        if (state != found.states.begin()) --state;
        Rigid3 T = inverse(T_chaser_camera) * state->T_chaser_target;
        T.t = T.t / (1 + at(change, BatchUnknown::scale));  // units of the model (sensor_geometry.h)
        settings.frame = kept_[i].ledger.frame;  // errors of samples that frames share would not average out
        frame.brightness = narpa::observe_brightness(
            model_.render_scene(), camera, tracker_->target(), kept_[i].at, *image, T, settings,
            {at(change, BatchUnknown::light_x), at(change, BatchUnknown::light_y)});
    }
}

void BatchFrameFeed::finish(BatchInput& input) {
    const Camera& c = model_.scene().cameras[camera_];
    input.camera = c.model;
    // A camera without a mount is a chaser itself; its mount is then where the scene has it.
    input.T_chaser_camera = c.mount < 0 ? Rigid3{} : c.T_mount_camera;
    for (BatchFrame& f : frames_) f.time = path_.at(f.time.t_ns);
    input.frames = std::move(frames_);
    input.target = tracker_->target();
}

BatchSweepFeed::BatchSweepFeed(const World& truth, const World& model, std::size_t lidar,
                               const TrackerOptions& options, std::unique_ptr<SweepTracker> tracker)
    : truth_(truth),
      model_(model),
      lidar_(lidar),
      noise_(range_noise_of(model.scene().lidars[lidar])),
      tracker_(std::move(tracker)),
      reader_(*truth.scene().lidars[lidar].model) {
    if (options.range_noise_m > 0) noise_.range_m = options.range_noise_m;
}

Result<std::unique_ptr<BatchSweepFeed>> BatchSweepFeed::create(const World& truth, const World& model,
                                                               std::size_t lidar, const TrackerOptions& options) {
    auto tracker = SweepTracker::create(truth, model, lidar, options);
    if (!tracker) return tracker.error();
    return std::unique_ptr<BatchSweepFeed>(new BatchSweepFeed(truth, model, lidar, options, *std::move(tracker)));
}

ChaserSample BatchSweepFeed::sample(std::int64_t t_ns) const {
    const Lidar& l = truth_.scene().lidars[lidar_];
    BodyPoses at(truth_.scene().bodies.size());
    truth_.place(t_ns, l.mount, at);
    const Rigid3 T_chaser_lidar = l.mount < 0 ? Rigid3{} : l.T_mount_lidar;
    return {t_ns, truth_.sensor_pose(l.mount, l.T_mount_lidar, at) * inverse(T_chaser_lidar),
            at.T_world_body[tracker_->target()]};
}

void BatchSweepFeed::take(const ReplayedSweep& made, std::int64_t stamp_late_ns, double longer_m) {
    LidarSweep sweep;
    for (const ReplayedSweep::Packet& p : made.packets) reader_.append(p.bytes, p.t_ns - made.t_ns, sweep);
    for (RangePoint& p : sweep.points) p.range_m += longer_m;
    sweep.empty.clear();  // beside the target, they would pass through a model that is too large
    TrackedFrame f = tracker_->take(made.sweep, made.t_ns, made.t_end_ns, std::move(sweep));
    if (f.measured) {
        const std::int64_t stamp_ns = f.t_ns + stamp_late_ns;
        sweeps_.push_back({time_of(sample(stamp_ns), sample(stamp_ns + kRateStep_ns)),
                           *f.measured,
                           {tracker_->points(), tracker_->motion()}});
    }
    tracked_.push_back(std::move(f));
}

void BatchSweepFeed::finish(BatchInput& input) {
    const Lidar& l = model_.scene().lidars[lidar_];
    input.T_chaser_lidar = l.mount < 0 ? Rigid3{} : l.T_mount_lidar;
    input.tracer = &model_.tracer();
    input.target = tracker_->target();
    input.noise = noise_;
    input.sweeps = std::move(sweeps_);
}

}  // namespace narpa
