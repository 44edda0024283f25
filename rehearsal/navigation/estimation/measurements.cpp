#include "rehearsal/navigation/estimation/measurements.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "estimator/cloud/own_body.h"
#include "estimator/view/measured_image.h"
#include "renderer/camera/scene_camera.h"

namespace narpa::rehearsal {
namespace {

/// Radius of the search around the prediction, in standard deviations.
constexpr double kSearchSigmas = 4;
/// Initial error, in pixels of a pyramid level, from which that level converges.
constexpr double kDenseReach_px = 1;

/// Factor (sensor pixels per pixel, each way) of the coarsest level that dense alignment needs from a prediction.
int coarsest_level(const Prediction& predicted, const Camera& camera, double range_m, double reach_m, int most) {
    const double off_m = kSearchSigmas * (predicted.position_sigma_m + predicted.rotation_sigma_rad * reach_m);
    const double off_px = camera.model->pixels_per_radian() * off_m / range_m;
    int factor = 1;
    while (factor < most && off_px > kDenseReach_px * factor) factor *= 2;
    return factor;
}

}  // namespace

CameraPoseEstimator::CameraPoseEstimator(SceneModel& model, std::size_t camera, const CameraMethod& method,
                                         std::uint64_t seed)
    : model_(model),
      camera_(model.scene().cameras[camera]),
      method_(method),
      estimator_(method.make(model.render_scene(), camera_, model.target(),
                             {.seed = ~seed,  // differs from the seed of the frames' random numbers
                              .guesses_are_predictions = true,
                              .model = model.uncertainty()})) {}

MeasurementResult CameraPoseEstimator::measure(std::span<const std::uint8_t> bytes, std::int64_t t_ns,
                                               const Prediction& predicted) {
    const std::int64_t start_ns = monotonic_ns();
    MeasurementResult out;
    const auto image = measured_image(camera_, bytes);
    if (!image) {
        out.why = image.error().what;
        return out;
    }
    const Rigid3& T = predicted.T_chaser_target;
    const BodyPoses& at = model_.place(predicted.t_s, normalized(predicted.q_world_chaser * T.q), inverse(T));
    FrameInput frame{.image = *image, .at = at};
    frame.guess = inverse(camera_.T_mount_camera) * T;
    out.why = history_.staleness(bytes, t_ns, frame.guess);
    if (!out.why.empty()) return out;
    frame.motion = rotated(conjugate(camera_.T_mount_camera.q), predicted.motion);
    // The light is known in camera axes, from the chaser's attitude.
    frame.T_world_camera = at.T_world_body[model_.chaser()] * camera_.T_mount_camera;
    frame.coarsest = coarsest_level(predicted, camera_, norm(frame.guess.t),
                                    model_.tracer().bounding_radius_m(model_.target()), frame.coarsest);
    frame.seed_offset = ++frames_;
    const auto e = estimator_->estimate(frame);
    out.ms = seconds_since(start_ns) * 1e3;
    if (!e) {
        out.why = e.error().what;
        return out;
    }
    out.points = e->measurements;
    out.answer = e->answer.kind;
    out.why = e->answer.why;
    if (!e->answer.usable()) return out;
    const double factor = method_.variance_between_frames;
    out.pose = {.t_ns = t_ns,
                .T_sensor_target = e->T_camera_target,
                .covariance = factor * (e->covariance - e->covariance_of_model) + e->covariance_of_model,
                .T_chaser_sensor = camera_.T_mount_camera,
                .covariance_of_model = e->covariance_of_model};
    // With a factor, only where motions are not observed: the root's information includes the model's uncertainty.
    if (factor == 1 || e->answer.kind == AnswerKind::unobservable)
        out.pose->root_information = e->answer.root_information / std::sqrt(factor);
    return out;
}

MeasurementResult LidarPoseEstimator::measure(LidarSweep sweep, std::int64_t t_ns, const Prediction& predicted) {
    const std::int64_t start_ns = monotonic_ns();
    MeasurementResult out;
    const Quat q_lidar_chaser = conjugate(lidar_.T_mount_lidar.q);
    const ApparentMotion in_lidar = rotated(q_lidar_chaser, predicted.motion);
    const Rigid3 guess = inverse(lidar_.T_mount_lidar) * predicted.T_chaser_target;
    const double reach_m = model_->tracer().bounding_radius_m(model_->target());
    const double off_m = kSearchSigmas * (predicted.position_sigma_m + predicted.rotation_sigma_rad * reach_m);
    // Most beams without return pass far from the target.
    std::erase_if(sweep.empty, [&](const EmptyBeam& b) {
        const Vec3 to_target = guess.t + b.t_s * in_lidar.velocity_m_s - b.origin_m;
        const double along = dot(to_target, b.direction);
        return along < 0 || dot(to_target, to_target) - along * along > std::pow(reach_m + off_m, 2);
    });
    remove_own_body(model_->tracer(), lidar_, sweep);
    const auto e =
        icp_.align(sweep.points, in_lidar, guess,
                   search_radius_m(predicted.position_sigma_m, predicted.rotation_sigma_rad, reach_m), sweep.empty);
    out.ms = seconds_since(start_ns) * 1e3;
    if (!e) {
        out.why = e.error().what;
        return out;
    }
    out.points = static_cast<int>(e->used);
    out.answer = e->answer.kind;
    out.why = e->answer.why;
    if (!e->answer.usable()) return out;
    out.pose = {.t_ns = t_ns,
                .T_sensor_target = e->T_lidar_target,
                .covariance = e->covariance,
                .T_chaser_sensor = lidar_.T_mount_lidar,
                .root_information = e->answer.root_information,
                .covariance_of_model = e->covariance_of_model};
    return out;
}

}  // namespace narpa::rehearsal
