#include "bench/estimation/approach.h"

#include <fmt/format.h>

#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <random>

#include "base/time.h"
#include "bench/statistics.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/uncertainty/observed_error.h"
#include "renderer/detector/detector.h"
#include "tracking/estimate_report.h"

namespace narpa {
namespace {

/// Ends of the range bands, m.
constexpr std::array kBandEnds{std::numeric_limits<double>::infinity(), 30.0, 10.0, 3.0, 0.0};
/// A pose counts as found where at most this fraction of the start's error is left.
constexpr double kFoundPart = 0.2;

/// RMS offset of the camera from the line of approach, and of its aim from the target's origin, over the range.
constexpr double kOffset = 0.03;

BodyPoses at_time_0(const World& world) {
    BodyPoses at(world.scene().bodies.size());
    world.place(0, -1, at);
    return at;
}

/// The camera as the estimators know it: without the ignored properties.
Camera without(const std::vector<std::string>& ignored, Camera camera) {
    for (const std::string& what : ignored) {
        if (what == "distortion") camera.model = std::make_shared<const Pinhole>(paraxial_pinhole(*camera.model));
        if (what == "rows" && camera.shutter) camera.shutter->row_time_ns = 0;
        if (what == "shutter") camera.shutter.reset();
        if (what == "psf") camera.optics.point_spread.reset();
    }
    return camera;
}

/// `off`: the error of the guess.
ApproachFrame estimate(FrameEstimator& method, const ApproachView& view, const Rigid3& guess, const Vector6& off,
                       bool with_bound) {
    ApproachFrame out;
    out.range_m = norm(view.truth.t);
    const std::int64_t start_ns = monotonic_ns();
    const FrameInput frame{
        .image = view.image, .at = view.at, .guess = guess, .motion = view.motion, .variance = view.variance_dn2};
    const auto e = method.estimate(frame);
    out.ms = seconds_since(start_ns) * 1e3;
    if (!e) return out;
    out.claimed = e->answer.usable(), out.why = e->answer.why, out.renders = e->renders;
    if (!out.claimed) return out;
    const Vector6 error = error_between(e->T_camera_target, view.truth);
    out.rotation_rad = error.head<3>().norm(), out.position_m = error.tail<3>().norm();
    const ObservedError nees = observed_error(e->T_camera_target, e->covariance, e->answer, view.truth);
    out.nees = nees.squared, out.observed = nees.freedom;
    out.found =
        out.rotation_rad < kFoundPart * off.head<3>().norm() && out.position_m < kFoundPart * off.tail<3>().norm();
    if (!with_bound || !out.found) return out;
    if (const auto bound = method.bound(frame, view.truth))
        out.bound_rotation_rad = rotation_sigma(*bound), out.bound_position_m = position_sigma(*bound);
    return out;
}

ApproachBand band_of(const std::vector<ApproachFrame>& frames, double from_m, double to_m) {
    ApproachBand b{from_m, to_m};
    Mean turn, shift, turn_of_bound, shift_of_bound, renders;
    std::vector<double> ms, nees;
    for (const ApproachFrame& f : frames) {
        if (f.range_m >= from_m || f.range_m < to_m) continue;
        ++b.frames;
        b.wrong += f.claimed && !(f.nees <= kSixSigmaNees);
        ms.push_back(f.ms);
        renders.add(f.renders);
        if (!f.found) continue;
        ++b.found;
        turn.add(f.rotation_rad), shift.add(f.position_m);
        if (f.observed == 6) nees.push_back(f.nees);
        if (!(f.bound_rotation_rad > 0)) continue;
        turn_of_bound.add(f.rotation_rad / f.bound_rotation_rad);
        shift_of_bound.add(f.position_m / f.bound_position_m);
    }
    b.rotation_rms_rad = turn.rms(), b.position_rms_m = shift.rms();
    b.rotation_of_bound = turn_of_bound.rms(), b.position_of_bound = shift_of_bound.rms();
    b.nees_median = quantile(nees, 0.5), b.ms_median = quantile(ms, 0.5);
    b.renders_mean = renders.mean();
    return b;
}

}  // namespace

ApproachFrames::ApproachFrames(const World& world, const Camera& camera, std::size_t target,
                               const ApproachOptions& options)
    : options_(options),
      camera_(camera),
      at_(at_time_0(world)),
      sensor_(sensor_model(camera)),
      view_(world.render_scene(), camera_, target, at_),
      bytes_(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns})),
      made_{{}, {}, at_, {}, {}} {}

/// A camera near the line of approach, aimed nearly at the target's origin.
Rigid3 ApproachFrames::pose(double range_m, std::uint32_t number) const {
    std::mt19937_64 random(options_.seed * 1'000'003 + number);
    std::normal_distribution<double> normal;
    const auto some = [&](double sigma) {
        const double x = sigma * normal(random), y = sigma * normal(random), z = sigma * normal(random);
        return Vec3{x, y, z};
    };
    const Vec3 position = range_m * (normalized(options_.along) + some(kOffset));
    const Vec3 z = normalized(-position);  // the camera points along its z, its y is down
    const Vec3 x = normalized(cross(z, options_.up));
    const Quat aimed = quat_from_columns(x, cross(z, x), z);
    return inverse({aimed * exp_rotation(some(kOffset)), position});
}

/// The camera turns about an axis of its own, and moves in a direction of its own, across the line of sight.
ApparentMotion ApproachFrames::motion(std::uint32_t number) const {
    std::mt19937_64 random(options_.seed * 1'000'033 + number);
    std::uniform_real_distribution<double> around(0, 2 * std::numbers::pi);
    const double axis = around(random), direction = around(random);
    const Vec3 rate = -options_.turn_rad_s * Vec3{std::cos(axis), std::sin(axis), 0};
    const Vec3 passing = options_.speed_m_s * Vec3{std::cos(direction), std::sin(direction), 0};
    return {cross(rate, made_.truth.t) + passing, rate};
}

const ApproachView& ApproachFrames::make(int k, int n) {
    const double part = n > 1 ? static_cast<double>(k) / (n - 1) : 0;
    return make_at(options_.from_m * std::pow(options_.to_m / options_.from_m, part),
                   static_cast<std::uint32_t>(k));
}

const ApproachView& ApproachFrames::make_at(double range_m, std::uint32_t number) {
    made_.truth = pose(range_m, number);
    FrameSettings settings;
    settings.spp = options_.frame_spp;
    settings.seed = ~options_.seed;  // not that of the renders that it is compared with
    settings.frame = number;
    made_.motion = motion(number);
    view_.begin_frame(at_, made_.motion, row_times(camera_));
    view_.render(made_.truth, settings, true);
    expose(camera_, view_.radiance(), settings.seed, number, bytes_);
    made_.at.T_world_body = view_.placement().T_world_body;
    made_.image = *measured_image(camera_, bytes_);  // of the camera's own size
    const auto& [r, g, b] = sensor_.dn_per_radiance;
    const auto dn_per_mean = static_cast<float>(r + g + b);
    made_.variance_dn2.clear();
    for (const float v : view_.aovs().variance) made_.variance_dn2.push_back(v * dn_per_mean * dn_per_mean);
    made_.variance_dn2.resize(made_.image.dn.size());  // without the embedded line
    return made_;
}

std::vector<ApproachRun> run_approach(const World& world, std::size_t camera_index, std::size_t target,
                                      const ApproachOptions& o, TracingThreads& threads,
                                      const std::function<void(const std::string&)>& progress,
                                      const StopFlag& stop) {
    const Camera& camera = world.scene().cameras[camera_index];
    ApproachFrames frames(world, camera, target, o);
    std::vector<ApproachRun> runs;
    std::vector<std::unique_ptr<FrameEstimator>> methods;
    for (const CameraMethod& m : o.methods) {
        methods.push_back(m.make(world.render_scene(), without(o.ignored, camera), target, {.seed = o.seed}));
        runs.push_back({&m, {}, {}, {}});
    }
    // All methods estimate from the same frames and starts.
    std::mt19937_64 random(o.seed);
    for (int k = 0; k < o.frames && !stop; ++k) {
        progress(fmt::format("approach: frame {}/{}", k, o.frames));
        threads.arena.execute([&] {
            const ApproachView& view = frames.make(k, o.frames);
            const Vector6 off =
                random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(view.truth.t), random);
            for (std::size_t m = 0; m < methods.size(); ++m)
                runs[m].frames.push_back(estimate(*methods[m], view, displaced(view.truth, off), off, true));
        });
    }
    for (const double deg : o.basin_trials > 0 ? o.basin : std::vector<double>{}) {
        std::vector<BasinCell> cells(methods.size(), {deg, 0, 0});
        for (int k = 0; k < o.basin_trials && !stop; ++k) {
            progress(fmt::format("basin: {} deg, trial {}/{}", deg, k, o.basin_trials));
            threads.arena.execute([&] {
                const ApproachView& view =
                    frames.make_at(o.basin_range_m, static_cast<std::uint32_t>(o.frames + k));
                const Vector6 off = random_error(deg * kDegree, 0.01 * deg * norm(view.truth.t), random);
                for (std::size_t m = 0; m < methods.size(); ++m) {
                    cells[m].found += estimate(*methods[m], view, displaced(view.truth, off), off, false).found;
                    ++cells[m].trials;
                }
            });
        }
        for (std::size_t m = 0; m < methods.size(); ++m) runs[m].basin.push_back(cells[m]);
    }
    for (ApproachRun& run : runs) {
        for (std::size_t b = 1; b < kBandEnds.size(); ++b)
            run.bands.push_back(band_of(run.frames, kBandEnds[b - 1], kBandEnds[b]));
        run.bands.push_back(band_of(run.frames, std::numeric_limits<double>::infinity(), 0));
        std::erase_if(run.bands, [](const ApproachBand& b) { return b.frames == 0; });
    }
    return runs;
}

}  // namespace narpa
