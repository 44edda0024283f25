#include "tracking/camera_calibration.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "estimator/batch/camera_change.h"
#include "estimator/least_squares/median.h"

namespace narpa {
namespace {

/// In the first rounds the camera may be so wrong that answers are refused: their points are used too.
constexpr int kRoundsWithoutRefusal = 2;
/// And so wrong that points are matched with others: in these rounds each search starts from where it did at first.
constexpr int kRoundsFromStarts = 3;
/// Settled: no unknown moves by more, in its standard deviation.
constexpr double kSettled_sigmas = 0.5;
/// Fewer points of an image whose answer is refused say nothing.
constexpr std::size_t kFewestPoints = 8;
/// Images have times a second apart, as the batch orders its poses by them.
constexpr std::int64_t kBetweenImages_ns = 1'000'000'000;

class Calibrator {
public:
    Calibrator(const World& world, std::size_t camera, std::size_t target,
               const std::vector<CalibrationImage>& images, const CalibrationOptions& options)
        : world_(world),
          camera_(world.scene().cameras[camera]),
          target_(target),
          images_(images),
          options_(options) {
        batch_.has_motion = false;
        batch_.prior_sigma = options.prior_sigma;
        for (const CalibrationImage& i : images) {
            const Rigid3 T_world_camera = world.camera_pose(camera_, 0, i.at);
            starts_.push_back(inverse(T_world_camera) * i.at.T_world_body[target]);
            out_.views.emplace_back().file = i.file;
            out_.views.back().T_camera_target = starts_.back();
        }
    }

    [[nodiscard]] Result<CameraCalibration> calibrate() {
        if (const Status good = check(); !good) return good.error();
        poses_ = starts_;
        BatchValues change{};
        for (out_.rounds = 1; out_.rounds <= options_.rounds_max; ++out_.rounds) {
            auto model = changed_camera(*camera_.model, change);
            if (!model) return failed(model.error().what);
            out_.model = *model;
            find_points();
            if (input_.frames.empty()) return failed("no image shows the target near its pose at the start");
            auto solved = solve_batch(input_, batch_);
            if (!solved) return solved.error();
            out_.batch = *std::move(solved);
            double moved = 0;
            for (const BatchEstimate& e : out_.batch.unknowns) {
                moved = std::max(moved, std::abs(e.value - at(change, e.unknown)) / e.sigma);
                at(change, e.unknown) = e.value;
            }
            take_poses();
            out_.has_settled = out_.batch.settled && moved < kSettled_sigmas && out_.rounds >= kRoundsFromStarts;
            if (out_.has_settled) break;
        }
        out_.rounds = std::min(out_.rounds, options_.rounds_max);
        auto model = changed_camera(*camera_.model, change);
        if (!model) return failed(model.error().what);
        out_.model = *std::move(model);
        set_parameters();
        set_errors(change);
        return std::move(out_);
    }

private:
    [[nodiscard]] Error failed(const std::string& what) const {
        return Error{fmt::format("camera \"{}\": {}", camera_.name, what), world_.scene().file, 0, 0,
                     ErrorKind::failed};
    }

    [[nodiscard]] Status check() const {
        bool has_any = false;
        for (std::size_t i = 0; i < kBatchUnknowns; ++i) {
            if (!(options_.prior_sigma[i] > 0)) continue;
            has_any = true;
            if (std::ranges::find(kCameraUnknowns, static_cast<BatchUnknown>(i)) == kCameraUnknowns.end())
                return Error{fmt::format("{} is no unknown of a camera alone", batch_unknowns()[i].name)};
        }
        if (!has_any) return Error{"no unknown of the camera is to be estimated"};
        BatchValues smallest{};
        for (const BatchUnknown u : kCameraUnknowns)
            if (at(options_.prior_sigma, u) > 0) at(smallest, u) = 1e-12;
        if (const auto model = changed_camera(*camera_.model, smallest); !model)
            return Error{fmt::format("camera \"{}\": {}", camera_.name, model.error().what), world_.scene().file};
        return Ok{};
    }

    /// In all images, with the present camera and poses.
    void find_points() {
        Camera camera = camera_;
        camera.model = out_.model;
        const auto estimator = options_.method->make(world_.render_scene(), camera, target_,
                                                     {.seed = ~options_.seed, .spp = options_.spp});
        input_.camera = camera_.model;
        input_.frames.clear();
        for (std::size_t i = 0; i < images_.size(); ++i) {
            BodyPoses bodies = images_[i].at;
            const Rigid3 T_world_camera = world_.camera_pose(camera_, 0, bodies);
            bodies.set(target_, T_world_camera * poses_[i]);
            CalibrationView& view = out_.views[i];
            view.is_used = false;
            const auto found = estimator->estimate({.image = images_[i].image, .at = bodies, .guess = poses_[i]});
            if (!found) {
                view.answer = refused(found.error().what);
                continue;
            }
            view.answer = found->answer;
            const PointObservations& points = *estimator->points();
            if (points.size() == 0 ||
                (!found->answer.usable() && (out_.rounds > kRoundsWithoutRefusal || points.size() < kFewestPoints)))
                continue;
            view.is_used = true;
            input_.frames.push_back({{.t_ns = time_of(i)}, found->T_camera_target, points, {}});
        }
    }
    [[nodiscard]] static std::int64_t time_of(std::size_t image) {
        return kBetweenImages_ns * static_cast<std::int64_t>(image);
    }
    [[nodiscard]] static Answer refused(const std::string& why) {
        Answer answer;
        answer.kind = AnswerKind::refused, answer.why = why;
        return answer;
    }

    /// Poses of the solution, from which the next round starts. Images that are not used, and in the first rounds
    /// all, start where they did, at a range changed in the ratio of the solution's ranges to those of the starts:
    /// that of the focal lengths, if the starts are as wrong as the camera.
    void take_poses() {
        std::vector<double> ratios;
        for (const BatchState& s : out_.batch.states)
            ratios.push_back(norm(s.T_chaser_target.t) /
                             norm(starts_[static_cast<std::size_t>(s.t_ns / kBetweenImages_ns)].t));
        const double ratio = upper_median(std::span(ratios));
        for (std::size_t i = 0; i < poses_.size(); ++i) poses_[i] = {starts_[i].q, ratio * starts_[i].t};
        for (const BatchState& s : out_.batch.states) {
            const auto i = static_cast<std::size_t>(s.t_ns / kBetweenImages_ns);
            out_.views[i].T_camera_target = s.T_chaser_target;
            if (out_.rounds >= kRoundsFromStarts) poses_[i] = s.T_chaser_target;
            out_.views[i].covariance = s.pose_covariance;
        }
        for (const BatchResidual& r : out_.batch.residuals)
            out_.views[static_cast<std::size_t>(r.t_ns / kBetweenImages_ns)].residual = r;
    }

    void set_errors(const BatchValues& change) {
        const ChangedCamera camera(*camera_.model, change);
        double squares = 0, n = 0;
        ChangedImage image;
        for (const BatchFrame& f : input_.frames) {
            CalibrationView& view = out_.views[static_cast<std::size_t>(f.time.t_ns / kBetweenImages_ns)];
            for (std::size_t k = 0; k < f.points.size(); ++k) {
                if (!camera.project(view.T_camera_target * f.points.body_m[k], image)) continue;
                const Pixel seen = f.points.seen[k], off{seen.u - image.pixel.x(), seen.v - image.pixel.y()};
                view.seen.push_back(seen), view.error.push_back(off);
                squares += off.u * off.u + off.v * off.v, n += 1;
            }
        }
        out_.rms_px = n > 0 ? std::sqrt(squares / n) : 0;
    }

    /// Numbers of the files and their standard deviations, to first order in the changes.
    void set_parameters() {
        const ProjectionParameters start = camera_.model->parameters(), end = out_.model->parameters();
        const auto unknowns = static_cast<Eigen::Index>(out_.batch.unknowns.size());
        const auto place_of = [&](BatchUnknown u) {
            const auto found = std::ranges::find(out_.batch.unknowns, u, &BatchEstimate::unknown);
            return found == out_.batch.unknowns.end() ? Eigen::Index{-1} : found - out_.batch.unknowns.begin();
        };
        std::vector<Eigen::VectorXd> gradients;
        const auto add = [&](const char* name, double from, double to,
                             std::initializer_list<std::pair<BatchUnknown, double>> by) {
            Eigen::VectorXd gradient = Eigen::VectorXd::Zero(unknowns);
            bool is_known = true, is_determined = true;
            for (const auto& [u, slope] : by)
                if (const Eigen::Index k = place_of(u); k >= 0) {
                    gradient[k] = slope, is_known = false;
                    is_determined &= out_.batch.unknowns[static_cast<std::size_t>(k)].is_determined;
                }
            if (is_known) return;
            const double variance = gradient.dot(out_.batch.covariance * gradient);
            out_.parameters.push_back({name, from, to, std::sqrt(variance), is_determined});
            gradients.push_back(gradient);
        };
        using enum BatchUnknown;
        const auto changed = [&](BatchUnknown u) {
            const Eigen::Index k = place_of(u);
            return k < 0 ? 1 : 1 + out_.batch.unknowns[static_cast<std::size_t>(k)].value;
        };
        const Pinhole &a = start.pinhole, &b = end.pinhole;
        add("fx", a.fx, b.fx, {{focal, a.fx}});
        add("fy", a.fy, b.fy, {{focal, a.fy * changed(aspect)}, {aspect, a.fy * changed(focal)}});
        add("cx", a.cx, b.cx, {{centre_x, 1}});
        add("cy", a.cy, b.cy, {{centre_y, 1}});
        constexpr std::array kNames{"k1", "k2", "p1", "p2", "k3"};
        constexpr std::array kCoefficientsOf{k1, k2, p1, p2, k3};
        const auto value = [](const ProjectionParameters& p, std::size_t i) {
            return i < p.values.size() ? p.values[i] : 0;
        };
        for (std::size_t i = 0; i < kNames.size(); ++i)
            add(kNames[i], value(start, i), value(end, i), {{kCoefficientsOf[i], 1}});
        Eigen::MatrixXd G(unknowns, static_cast<Eigen::Index>(gradients.size()));
        for (std::size_t i = 0; i < gradients.size(); ++i) G.col(static_cast<Eigen::Index>(i)) = gradients[i];
        out_.covariance = G.transpose() * out_.batch.covariance * G;
    }

    const World& world_;
    const Camera& camera_;
    std::size_t target_;
    const std::vector<CalibrationImage>& images_;
    const CalibrationOptions& options_;
    BatchOptions batch_;
    BatchInput input_;
    std::vector<Rigid3> starts_, poses_;  ///< T_camera_target of each image: given, and of the next search
    CameraCalibration out_;
};

}  // namespace

BatchValues calibration_priors(const Camera& camera) {
    BatchValues sigma{};
    at(sigma, BatchUnknown::focal) = 0.25, at(sigma, BatchUnknown::aspect) = 0.02;
    at(sigma, BatchUnknown::centre_x) = 0.1 * camera.width, at(sigma, BatchUnknown::centre_y) = 0.1 * camera.height;
    const ProjectionKind* kind = camera.model->parameters().kind;
    if (kind != &kPinhole && kind != &kBrownConrady) return sigma;
    at(sigma, BatchUnknown::k1) = 1, at(sigma, BatchUnknown::k2) = 1, at(sigma, BatchUnknown::k3) = 1;
    at(sigma, BatchUnknown::p1) = at(sigma, BatchUnknown::p2) = 0.02;
    return sigma;
}

Result<CameraCalibration> calibrate_camera(const World& world, std::size_t camera, std::size_t target,
                                           const std::vector<CalibrationImage>& images,
                                           const CalibrationOptions& options) {
    if (const Status good = check_method(*options.method, world.scene(), target); !good) return good.error();
    return Calibrator(world, camera, target, images, options).calibrate();
}

}  // namespace narpa
