#include "estimator/method/camera_method.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/marks/mark_alignment.h"

namespace narpa {
namespace {

class FeatureEstimator final : public FrameEstimator {
public:
    FeatureEstimator(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                     const FrameEstimatorSettings& s)
        : alignment_(render_scene, camera, target, BodyPoses(render_scene.scene().bodies.size()), settings(s)) {}

    Result<FramePose> estimate(const FrameInput& f) override {
        FeatureEstimate e = alignment_.align(f.image, f.at, f.guess, f.motion);
        bound_ = e.bound;
        points_ = std::move(e.points);
        return FramePose{e.T_camera_target, e.covariance, e.covariance_of_model,
                         e.answer,          e.agreeing,   static_cast<int>(e.rounds.size())};
    }
    Result<Matrix6> bound(const FrameInput&, const Rigid3&) override { return bound_; }
    const PointObservations* points() const noexcept override { return &points_; }
    void set_detector(const Detector& detector) override { alignment_.set_detector(detector); }

private:
    static FeatureSettings settings(const FrameEstimatorSettings& s) {
        FeatureSettings f;
        f.spp = s.spp, f.seed = s.seed, f.model = s.model;
        if (s.guesses_are_predictions) f.renders_max = 4, f.settled_px = 0.1;
        return f;
    }

    FeatureAlignment alignment_;
    Matrix6 bound_ = Matrix6::Zero();
    PointObservations points_;
};

class DenseEstimator final : public FrameEstimator {
public:
    DenseEstimator(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                   const FrameEstimatorSettings& s)
        : render_(render_scene.scene().render), settings_(s), alignment_(render_scene, camera, target) {
        if (s.starts_from_features) features_.emplace(render_scene, camera, target, s);
    }

    Result<FramePose> estimate(const FrameInput& f) override {
        DenseOptions o = options(f);
        Rigid3 start = f.guess;
        int renders = 0;
        if (features_) {
            const auto from = features_->estimate(f);
            if (!from) return from.error();
            renders = from->renders;
            if (from->answer.usable()) start = from->T_camera_target, o.coarsest = 1;
        }
        const auto e = alignment_.align(f.image, f.at, start, o, f.variance);
        if (!e) return e.error();
        return FramePose{
            e->T_camera_body,    e->covariance, e->covariance_of_model, e->answer, static_cast<int>(e->pixels),
            renders + e->renders};
    }
    Result<Matrix6> bound(const FrameInput& f, const Rigid3& T_camera_target) override {
        return alignment_.bound(f.at, T_camera_target, options(f), f.variance);
    }
    void set_detector(const Detector& detector) override {
        alignment_.set_detector(detector);
        if (features_) features_->set_detector(detector);
    }

private:
    [[nodiscard]] DenseOptions options(const FrameInput& f) const {
        DenseOptions o;
        o.coarsest = f.coarsest;
        o.seed = settings_.seed + f.seed_offset;
        o.method = render_.method, o.max_depth = render_.max_depth;
        o.motion = f.motion;
        o.model = settings_.model;
        o.T_world_camera = f.T_world_camera;
        return o;
    }

    const RenderSettings& render_;
    FrameEstimatorSettings settings_;
    DenseAlignment alignment_;
    std::optional<FeatureEstimator> features_;
};

class MarkEstimator final : public FrameEstimator {
public:
    MarkEstimator(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                  const FrameEstimatorSettings& s)
        : alignment_(render_scene, camera, target, s.model) {}

    Result<FramePose> estimate(const FrameInput& f) override {
        MarkEstimate e = alignment_.align(f.image, f.guess, f.motion);
        bound_ = e.bound;
        points_ = std::move(e.points);
        return FramePose{e.T_camera_target, e.covariance, e.covariance_of_model, e.answer, e.marks, 0};
    }
    Result<Matrix6> bound(const FrameInput&, const Rigid3&) override { return bound_; }
    const PointObservations* points() const noexcept override { return &points_; }
    void set_detector(const Detector& detector) override { alignment_.set_detector(detector); }

private:
    MarkAlignment alignment_;
    Matrix6 bound_ = Matrix6::Zero();
    PointObservations points_;
};

template <class Estimator>
std::unique_ptr<FrameEstimator> make(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                     const FrameEstimatorSettings& settings) {
    return std::make_unique<Estimator>(render_scene, camera, target, settings);
}

Status needs_marks(const Scene& scene, std::size_t target) {
    const Body& body = scene.bodies[target];
    if (!body.marks.empty()) return Ok{};
    return Error{
        fmt::format("body \"{}\" has no marks, expected [[body.mark]] for the method \"marks\"", body.name),
        scene.file};
}

constexpr std::array<CameraMethod, 3> kMethods{
    {{.name = "features",
      .measures = "points",
      .help = "points of the frame and of a render",
      .finds_points = true,
      .light_is_that_of_the_guess = true,
      // Consecutive frames show the same details in nearly the same pixels: their errors correlate by 0.2 to 0.3
      // from one second to the next between 18 and 3 m.
      .variance_between_frames = 2.5,
      .make = make<FeatureEstimator>},
     {.name = "dense",
      .measures = "all pixels",
      .help = "all pixels, starting from the features' pose",
      .takes_frame_noise = true,
      .make = make<DenseEstimator>},
     {.name = "marks",
      .measures = "marks",
      .help = "lamps, reflectors and tags that the scene states for the target",
      .finds_points = true,
      // In frames sampled at the centres of pixels, marks at the same places between them have the same errors.
      .variance_between_frames = 2,
      .needs = needs_marks,
      .make = make<MarkEstimator>}}};

/// Names of the methods that can do this, separated by " or ".
std::string names_of_methods(bool CameraMethod::*can) {
    std::string all;
    for (const CameraMethod& m : kMethods)
        if (m.*can) all += (all.empty() ? "" : " or ") + std::string(m.name);
    return all;
}

}  // namespace

std::span<const CameraMethod> camera_methods() noexcept {
    return kMethods;
}

const CameraMethod* find_camera_method(std::string_view name) noexcept {
    const auto found = std::ranges::find(kMethods, name, &CameraMethod::name);
    return found == kMethods.end() ? nullptr : &*found;
}

Status check_method(const CameraMethod& method, const Scene& scene, std::size_t target) {
    return method.needs ? method.needs(scene, target) : Status{Ok{}};
}

std::string help_of_camera_methods() {
    std::string all;
    for (const CameraMethod& m : kMethods)
        all += (all.empty() ? "" : "; ") + std::string(m.name) + ": " + std::string(m.help);
    return all;
}

std::string camera_methods_that_take_noise() {
    return names_of_methods(&CameraMethod::takes_frame_noise);
}

std::string camera_methods_that_find_points() {
    return names_of_methods(&CameraMethod::finds_points);
}

}  // namespace narpa
