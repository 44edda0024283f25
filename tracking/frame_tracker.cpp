#include "tracking/frame_tracker.h"

#include <fmt/format.h>

#include <random>

#include "base/time.h"
#include "emulator/camera/camera_control.h"
#include "estimator/search/pose_search.h"

namespace narpa {
namespace {

/// Initial standard deviations of velocity and rate, until the second frame.
constexpr double kFirstVelocity_m_s = 1, kFirstRate_rad_s = 0.1;
/// Standard deviations beyond which the target counts as lost, because a render would not match the frame.
/// kLostShift is a fraction of the range.
constexpr double kLostTurn_rad = 0.5, kLostShift = 0.2;

PoseTrackerSettings tracker_settings(const TrackerOptions& options) {
    PoseTrackerSettings settings;
    settings.filter.motion.acceleration_psd = options.acceleration_psd;
    settings.filter.motion.angular_acceleration_psd = options.angular_acceleration_psd;
    settings.first_velocity_m_s = kFirstVelocity_m_s;
    settings.first_rate_rad_s = kFirstRate_rad_s;
    return settings;
}

/// Copies the answer of a method and, where it is usable, the pose and its covariance.
void take_answer(const auto& estimate, const Rigid3& pose, TrackedFrame& out) {
    out.answer = estimate.answer;
    out.why = estimate.answer.why;
    if (!estimate.answer.usable()) return;
    out.measured = pose;
    out.covariance = estimate.covariance;
    out.covariance_of_model = estimate.covariance_of_model;
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

Rigid3 displaced_truth(const Rigid3& truth, const TrackerOptions& o, std::mt19937_64& random) {
    return displaced(truth, random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(truth.t), random));
}

EstimateReport TrackedFrame::report(std::uint8_t camera) const {
    const auto deviation = [&](int i) { return std::sqrt(filtered_covariance(i, i)); };
    return {frame,
            camera,
            state,
            answer.kind,
            t_ns,
            filtered,
            {deviation(0), deviation(1), deviation(2)},
            {deviation(3), deviation(4), deviation(5)}};
}

FrameTracker::FrameTracker(const World& world, std::size_t camera, std::size_t target,
                           const TrackerOptions& options)
    : world_(world),
      camera_(world.scene().cameras[camera]),
      index_(camera),
      target_(target),
      options_(options),
      random_(options.seed),
      tracker_(tracker_settings(options)) {
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

Status FrameTracker::set(const FrameLedger& ledger) {
    if (!camera_.control) return Ok{};
    const Camera& as_in_the_scene = world_.scene().cameras[index_];
    const CameraSettings taken = settings_of(ledger, as_in_the_scene);
    apply(taken, as_in_the_scene, camera_);
    estimator_->set_detector(*camera_.detector);
    if (search_) search_->set_detector(*camera_.detector);
    if (taken.binning == 1 && taken.region.width == camera_.width && taken.region.height == camera_.height)
        return Ok{};
    return Error{fmt::format("{} x {} pixels, binned by {}: expected the whole image, not binned",
                             taken.region.width, taken.region.height, taken.binning)};
}

ApparentMotion FrameTracker::motion(const FrameLedger& ledger, const BodyPoses& at, const Rigid3& guess) const {
    const double length_s = 1e-9 * static_cast<double>(ledger.t_exposure_end_ns - ledger.t_exposure_start_ns);
    if (!camera_.shutter || !(length_s > 0)) return {};
    const double middle_s = 1e-9 * static_cast<double>(ledger.t_exposure_mid_ns);
    const auto q_frame_chaser = [&](double time) {
        const double t_s = middle_s + (time - kMidExposure) * length_s;
        return (world_.camera_pose(camera_, t_s, at, time) * inverse(T_chaser_camera())).q;
    };
    const Quat q_middle = q_frame_chaser(kMidExposure);
    const Rigid3 T_chaser_target = T_chaser_camera() * guess;
    const auto known = tracker_.started() ? tracker_.filter().state() : RelativeState{};
    const auto at_time = [&](double time) {
        const double t_s = (time - kMidExposure) * length_s;
        const Quat q = conjugate(q_frame_chaser(time));
        const Rigid3 T{normalized(q * q_middle * T_chaser_target.q * exp_rotation(t_s * known.rate_rad_s)),
                       q * (q_middle * T_chaser_target.t + t_s * known.velocity_m_s)};
        return inverse(T_chaser_camera()) * T;
    };
    return motion_between(at_time(0), at_time(1), length_s);
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
    if (tracker_.started()) tracker_.filter().predict(t_ns);
    if (tracker_.started() && !is_tracked(q_frame_chaser)) tracker_.stop();
    if (tracker_.started()) {
        out.guess = inverse(T_chaser_camera()) * tracker_.filter().pose(q_frame_chaser).T_chaser_target;
    } else if (!searches()) {
        out.guess = options_.guess ? *options_.guess : displaced_truth(out.truth, options_, random_);
    }
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
    if (options_.guess) frame.T_world_camera = T_world_camera;
    if (image)
        measure(frame, T_world_camera, out);
    else
        out.why = image.error().what;
    if (out.measured) {
        // The model's errors are common to all frames, so the filter gets the covariance without them.
        PoseMeasurement measurement{t_ns, *out.measured, out.covariance - out.covariance_of_model,
                                    T_chaser_camera(), q_frame_chaser};
        if (out.answer.kind == AnswerKind::unobservable) measurement.root_information = out.answer.root_information;
        const UpdateResult update = tracker_.update(measurement);
        out.nis = update.nis;
        if (update.outcome != UpdateOutcome::taken) out.why = update.why;
        if (update.outcome == UpdateOutcome::taken) {
            out.state = EstimateState::measured;
            covariance_of_model_ = out.covariance_of_model;
        }
    }
    if (tracker_.started()) {
        // Chaser axes to camera axes: the mounting is exact.
        const PoseFilter::Pose known = tracker_.filter().pose(q_frame_chaser);
        const Rigid3 T_camera_chaser = inverse(T_chaser_camera());
        out.filtered = T_camera_chaser * known.T_chaser_target;
        out.filtered_covariance =
            covariance_in_other_axes(T_camera_chaser.q, known.covariance) + covariance_of_model_;
        if (out.state == EstimateState::lost) out.state = EstimateState::predicted;
    }
    out.ms = seconds_since(start_ns) * 1e3;
    if (out.measured) {  // after the estimate, and not part of its time
        const Rigid3& there = options_.guess ? *out.measured : out.truth;
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
    take_answer(*e, e->T_camera_target, out);
}

void FrameTracker::measure_by_search(const FrameInput& frame, const Rigid3& T_world_camera, TrackedFrame& out) {
    SearchOptions o;
    const double most = options_.guess ? 0 : o.range_part;
    const double off = std::uniform_real_distribution(-most, most)(random_);
    o.range_m = options_.range_guess_m > 0 ? options_.range_guess_m : norm(out.truth.t) / (1 + off);
    o.dense = dense_options();
    const auto e = search_->find(frame.image, frame.at, T_world_camera, o, frame.variance);
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = static_cast<int>(e->pixels);
    out.renders = e->renders;
    take_answer(*e, e->T_camera_target, out);
}

std::vector<float> FrameTracker::frame_variance() const {
    if (!options_.frame_noise_dn) return {};
    const int rows = camera_.height - (camera_.embedded_line ? 1 : 0);
    return std::vector<float>(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(rows),
                              static_cast<float>(std::pow(*options_.frame_noise_dn, 2)));
}

DenseOptions FrameTracker::dense_options() const {
    DenseOptions dense;
    dense.model = options_.model;
    dense.seed = ~options_.seed;
    dense.method = world_.scene().render.method;
    dense.max_depth = world_.scene().render.max_depth;
    return dense;
}

bool FrameTracker::is_tracked(const Quat& q_frame_chaser) const {
    const PoseFilter::Pose known = tracker_.filter().pose(q_frame_chaser);
    return rotation_sigma(known.covariance) < kLostTurn_rad &&
           position_sigma(known.covariance) < kLostShift * norm(known.T_chaser_target.t);
}

}  // namespace narpa
