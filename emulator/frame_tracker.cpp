#include "emulator/frame_tracker.h"

#include <fmt/format.h>

#include <chrono>
#include <random>

#include "base/time.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"

namespace narpa {
namespace {

/// Of what is known about velocity and rate before a second frame has been seen.
constexpr double kFirstVelocity_m_s = 1, kFirstRate_rad_s = 0.1;
/// Standard deviations beyond which the target is lost: a render there would show something else. Shift is a part
/// of the range.
constexpr double kMostTurn_rad = 0.5, kMostShift = 0.2;

PoseTrackerSettings tracker_settings(const TrackerOptions& options) {
    PoseTrackerSettings settings;
    settings.filter.motion.acceleration_psd = options.acceleration_psd;
    settings.filter.motion.angular_acceleration_psd = options.angular_acceleration_psd;
    settings.first_velocity_m_s = kFirstVelocity_m_s;
    settings.first_rate_rad_s = kFirstRate_rad_s;
    return settings;
}

}  // namespace

Result<std::size_t> target_of(const World& world, int mount, std::string_view sensor, const std::string& name) {
    const auto& bodies = world.scene().bodies;
    if (!name.empty()) {
        if (const auto body = world.body_named(name)) {
            if (static_cast<int>(*body) != mount) return *body;
            return Error{fmt::format("target \"{}\" carries \"{}\", expected another body", name, sensor),
                         world.scene().file};
        }
        std::string names;
        for (const Body& b : bodies) names += (names.empty() ? "" : ", ") + b.name;
        return Error{fmt::format("no body named \"{}\" to estimate the pose of, expected one of: {}", name, names),
                     world.scene().file};
    }
    for (std::size_t i = 0; i < bodies.size(); ++i)
        if (static_cast<int>(i) != mount && std::holds_alternative<int>(bodies[i].shape)) return i;
    return Error{
        fmt::format(
            "no body with a mesh but what carries \"{}\": expected one to estimate the pose of, or its name",
            sensor),
        world.scene().file};
}

Rigid3 off_truth(const Rigid3& truth, const TrackerOptions& o, std::mt19937_64& random) {
    return displaced(truth, random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(truth.t), random));
}

EstimateReport TrackedFrame::report(std::uint8_t camera) const {
    const auto deviation = [&](int i) { return std::sqrt(filtered_covariance(i, i)); };
    return {frame,
            camera,
            state,
            t_ns,
            filtered,
            {deviation(0), deviation(1), deviation(2)},
            {deviation(3), deviation(4), deviation(5)}};
}

struct FrameTracker::Impl {
    Impl(const World& w, const Camera& c, std::size_t body, const TrackerOptions& o)
        : world(w), camera(c), target(body), options(o), random(o.seed), tracker(tracker_settings(o)) {}

    /// What one frame says, from a guess.
    void measure(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out);
    void measure_by_points(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out);
    void measure_by_pixels(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out);
    void fuse(const PoseMeasurement& measurement, TrackedFrame& out);
    /// Well enough for a render to be compared from there.
    [[nodiscard]] bool knows_where(const Quat& q_frame_chaser) const;
    /// The chaser is the body that carries the camera, or the camera itself.
    [[nodiscard]] Rigid3 T_chaser_camera() const { return camera.mount < 0 ? Rigid3{} : camera.T_mount_camera; }

    const World& world;
    const Camera camera;
    std::size_t target;
    TrackerOptions options;
    std::mt19937_64 random;
    std::optional<FeatureAlignment> by_points;
    std::optional<DenseAlignment> by_pixels;
    DenseOptions dense_used;  ///< with the last frame
    PoseTracker tracker;
};

Result<std::unique_ptr<FrameTracker>> FrameTracker::create(const World& world, std::size_t camera_index,
                                                           const TrackerOptions& options) {
    const Camera& camera = world.scene().cameras[camera_index];
    const auto target = target_of(world, camera.mount, camera.name, options.target);
    if (!target) return target.error();
    auto impl = std::make_unique<Impl>(world, camera, *target, options);
    FeatureSettings features;
    features.spp = options.spp;
    features.seed = ~options.seed;  // not the random numbers of the frames, whose seed may be the same
    impl->by_points.emplace(world.render_scene(), camera, *target, BodyPoses(world.scene().bodies.size()),
                            features);
    if (options.method == EstimateMethod::dense) impl->by_pixels.emplace(world.render_scene(), camera, *target);
    return std::unique_ptr<FrameTracker>(new FrameTracker(std::move(impl)));
}

FrameTracker::FrameTracker(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FrameTracker::~FrameTracker() = default;

std::size_t FrameTracker::target() const noexcept {
    return impl_->target;
}
const TrackerOptions& FrameTracker::options() const noexcept {
    return impl_->options;
}

TrackedFrame FrameTracker::take(std::uint32_t frame, std::int64_t t_ns, std::span<const std::uint8_t> bytes,
                                const BodyPoses& at) {
    Impl& m = *impl_;
    const std::int64_t start_ns = monotonic_ns();
    TrackedFrame out;
    out.frame = frame;
    out.t_ns = t_ns;
    const Rigid3 T_world_camera = m.world.sensor_pose(m.camera.mount, m.camera.T_mount_camera, at);
    out.truth = inverse(T_world_camera) * at.T_world_body[m.target];
    const Quat q_frame_chaser = (T_world_camera * inverse(m.T_chaser_camera())).q;
    if (m.tracker.started()) m.tracker.filter().predict(t_ns);
    if (m.tracker.started() && !m.knows_where(q_frame_chaser)) m.tracker.stop();
    if (m.tracker.started()) {
        out.guess = inverse(m.T_chaser_camera()) * m.tracker.filter().pose(q_frame_chaser).T_chaser_target;
    } else {
        out.guess = off_truth(out.truth, m.options, m.random);
    }
    if (const auto image = measured_image(m.camera, bytes)) {
        m.measure(*image, at, out);
    } else {
        out.why = image.error().what;
    }
    if (out.measured) m.fuse({t_ns, *out.measured, out.covariance, m.T_chaser_camera(), q_frame_chaser}, out);
    if (m.tracker.started()) {
        // Chaser axes to camera axes: the mounting is exact.
        const PoseFilter::Pose known = m.tracker.filter().pose(q_frame_chaser);
        const Rigid3 T_camera_chaser = inverse(m.T_chaser_camera());
        out.filtered = T_camera_chaser * known.T_chaser_target;
        out.filtered_covariance = covariance_in_other_axes(T_camera_chaser.q, known.covariance);
        if (out.state == EstimateState::lost) out.state = EstimateState::predicted;
    }
    out.ms = seconds_since(start_ns) * 1e3;
    // What follows looks at the truth: nothing of the estimate.
    if (m.by_pixels && out.measured)
        if (const auto bound = m.by_pixels->bound(at, out.truth, m.dense_used)) out.bound = *bound;
    return out;
}

void FrameTracker::Impl::measure(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out) {
    measure_by_points(image, at, out);
    if (by_pixels) measure_by_pixels(image, at, out);
}

void FrameTracker::Impl::measure_by_points(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out) {
    const FeatureEstimate e = by_points->align(image, at, out.guess);
    out.matches = e.agreeing;
    out.renders = static_cast<int>(e.rounds.size());
    if (!e.ok()) {
        out.why = fmt::format("{} in {} renders", name(e.status), e.rounds.size());
        return;
    }
    out.measured = e.T_camera_target;
    out.covariance = e.covariance;
    out.bound = e.bound;
}

/// From where the points lead; from the guess where they lead nowhere.
void FrameTracker::Impl::measure_by_pixels(const MeasuredImage& image, const BodyPoses& at, TrackedFrame& out) {
    DenseOptions dense;
    dense.seed = ~options.seed;
    dense.method = world.scene().render.method;
    dense.max_depth = world.scene().render.max_depth;
    if (out.measured) dense.coarsest = 1;
    const auto e = by_pixels->align(image, at, out.measured.value_or(out.guess), dense);
    out.measured.reset();
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = static_cast<int>(e->pixels);
    out.renders += static_cast<int>(e->steps.size());
    if (e->status != DenseStatus::converged) {
        out.why = std::string(name(e->status));
        return;
    }
    out.measured = e->T_camera_body;
    out.covariance = e->covariance;
    dense_used = dense;
}

bool FrameTracker::Impl::knows_where(const Quat& q_frame_chaser) const {
    const PoseFilter::Pose known = tracker.filter().pose(q_frame_chaser);
    return rotation_sigma(known.covariance) < kMostTurn_rad &&
           position_sigma(known.covariance) < kMostShift * norm(known.T_chaser_target.t);
}

void FrameTracker::Impl::fuse(const PoseMeasurement& measurement, TrackedFrame& out) {
    const UpdateResult update = tracker.update(measurement);
    out.nis = update.nis;
    out.why = update.why;
    if (update.outcome == UpdateOutcome::taken) out.state = EstimateState::measured;
}

}  // namespace narpa
