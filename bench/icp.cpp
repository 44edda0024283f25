#include "bench/icp.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "bench/statistics.h"
#include "renderer/film/camera_image.h"

namespace narpa {
namespace {

/// Found: within so many standard deviations of the bound at the truth. Other minima are hundreds of them away.
constexpr double kFoundSigma = 10;

class Sweeps {
public:
    Sweeps(const World& world, std::size_t target, const IcpBenchSettings& settings, std::uint64_t stream)
        : world_(world),
          target_(target),
          settings_(settings),
          model_(*settings.model),
          random_(settings.seed * 1'000'003 + stream),
          placement_(world.scene().bodies.size()),
          shots_(model_.spec().shots_per_packet),
          range_m_(shots_.size()),
          reflectivity_(shots_.size()),
          points_(shots_.size()),
          bytes_(model_.spec().data_packet_bytes) {}

    [[nodiscard]] double uniform(double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    [[nodiscard]] double normal() { return std::normal_distribution<double>()(random_); }
    [[nodiscard]] Vec3 direction() { return normalized(Vec3{normal(), normal(), normal()}); }

    /// The target's x axis points back at the LiDAR, within the cone; any roll; slightly off the LiDAR's y axis.
    [[nodiscard]] Rigid3 pose() {
        const double distance = uniform(settings_.distance_min_m, settings_.distance_max_m);
        const Vec3 aim = normalized(Vec3{uniform(-0.05, 0.05), 1, uniform(-0.05, 0.05)});
        const double off = std::acos(uniform(std::cos(settings_.cone_deg * kDegree), 1));
        const Vec3 x = -aim, side = normalized(cross(x, direction())), up = cross(x, side);
        const Vec3 axis = std::cos(off) * x + std::sin(off) * side;
        return {exp_rotation(uniform(-3.14, 3.14) * axis) *
                    quat_from_columns(axis, normalized(cross(up, axis)), cross(axis, normalized(cross(up, axis)))),
                distance * aim};
    }
    [[nodiscard]] SweepMotion motion() {
        const double v = settings_.velocity_m_s, w = settings_.rate_rad_s;
        return {{uniform(-v, v), uniform(-v, v), uniform(-v, v)}, {uniform(-w, w), uniform(-w, w), uniform(-w, w)}};
    }
    [[nodiscard]] Rigid3 start_near(const Rigid3& T, const IcpStarts& starts) {
        Vector6 e;
        e << to_eigen(starts.angle_deg * kDegree * direction()),
            to_eigen(starts.distance_fraction * norm(T.t) * direction());
        return displaced(T, e);
    }

    /// One turn, from behind to behind. The pose is valid at its middle, when the rotor points forward. Points pass
    /// through the model's packets.
    void scan(const Rigid3& T_lidar_target, const SweepMotion& motion, std::vector<RangePoint>& out) {
        const auto turn_ns = static_cast<std::int64_t>(1e9 / settings_.rotation_hz);
        out.clear();
        const std::int64_t period_ns = model_.packet_period_ns(settings_.rotation_hz);
        const std::int64_t first = turn_ns / 2 / period_ns, last = 3 * turn_ns / 2 / period_ns;
        Vector6 rate;
        rate << to_eigen(motion.rate_rad_s), to_eigen(motion.velocity_m_s);
        for (std::int64_t packet = first; packet < last; ++packet) {
            model_.shots(packet, settings_.rotation_hz, shots_);
            const std::int64_t after_ns = packet * period_ns - turn_ns;
            for (std::size_t i = 0; i < shots_.size(); ++i) {
                const double t_s = 1e-9 * static_cast<double>(after_ns + shots_[i].t_offset_ns);
                placement_.set(target_, displaced(T_lidar_target, t_s * rate));
                range_m_[i] = range_of({shots_[i].origin_m, shots_[i].direction});
            }
            model_.encode(packet, settings_.rotation_hz, 0, range_m_, reflectivity_, bytes_);
            append_points(std::span(points_).first(model_.points(bytes_, points_)), after_ns, out);
        }
    }

private:
    /// Range to the target alone, with noise; 0: no return.
    double range_of(const Ray& beam) {
        RayBatch rays;
        HitBatch hits;
        rays.n = 1;
        rays.put(0, beam);
        const auto only = static_cast<std::uint32_t>(target_);
        world_.tracer().intersect(placement_, rays, {&only, 1}, hits);
        if (hits.met == 0 || hits.range_m[0] > settings_.range_max_m) return 0;
        return std::max(0.0, hits.range_m[0] + settings_.range_noise_m * normal());
    }

    const World& world_;
    std::size_t target_;
    const IcpBenchSettings& settings_;
    const LidarModel& model_;
    std::mt19937_64 random_;
    BodyPoses placement_;
    std::vector<LidarShot> shots_;
    std::vector<double> range_m_;
    std::vector<float> reflectivity_;
    std::vector<LidarPoint> points_;
    std::vector<std::uint8_t> bytes_;
};

/// Sums over the starts of one run.
struct Sums {
    double rotation2 = 0, translation2 = 0, rotation_to_bound2 = 0, translation_to_bound2 = 0, nees = 0, points = 0,
           iterations = 0;
    std::vector<double> microseconds;
    int compared = 0;

    void add(const CloudEstimate& e, const Rigid3& truth) {
        const Vector6 error = error_between(e.T_lidar_target, truth);
        ++compared;
        rotation2 += error.head<3>().squaredNorm();
        translation2 += error.tail<3>().squaredNorm();
        rotation_to_bound2 += error.head<3>().cwiseAbs2().cwiseQuotient(e.bound.diagonal().head<3>()).sum() / 3;
        translation_to_bound2 += error.tail<3>().cwiseAbs2().cwiseQuotient(e.bound.diagonal().tail<3>()).sum() / 3;
        nees += normalised_error_squared(error, e.covariance);
    }
    void put_into(IcpRun& run) {
        const auto rms = [&](double sum) { return std::sqrt(sum / std::max(1, compared)); };
        run.rotation_rms_deg = rms(rotation2) / kDegree;
        run.translation_rms_m = rms(translation2);
        run.rotation_to_bound = rms(rotation_to_bound2);
        run.translation_to_bound = rms(translation_to_bound2);
        run.nees = nees / std::max(1, compared);
        run.points = points / run.starts.count;
        run.iterations = iterations / run.starts.count;
        run.microseconds_p50 = quantile(microseconds, 0.5);
        run.microseconds_p99 = quantile(microseconds, 0.99);
    }
};

}  // namespace

std::vector<IcpRun> run_icp(const World& world, std::size_t target, const IcpBenchSettings& settings,
                            const std::vector<IcpStarts>& starts, const std::function<void(int, int)>& progress) {
    IcpSettings icp_settings = settings.icp;
    icp_settings.noise.range_m =
        std::hypot(settings.range_noise_m, settings.model->spec().range_resolution_m / std::sqrt(12.0));
    CloudIcp icp(world.tracer(), target, icp_settings);

    int done = 0, all = 0;
    for (const IcpStarts& at : starts) all += at.count;
    std::vector<IcpRun> runs;
    std::vector<RangePoint> points;
    for (const IcpStarts& at : starts) {
        Sweeps sweeps(world, target, settings, runs.size());
        IcpRun run{at};
        Sums sums;
        for (int i = 0; i < at.count; ++i) {
            const Rigid3 truth = sweeps.pose();
            const SweepMotion motion = sweeps.motion();
            sweeps.scan(truth, motion, points);
            const Rigid3 start = sweeps.start_near(truth, at);
            const double reach_m = world.tracer().bounding_radius_m(target);
            const double search_m = at.distance_fraction * norm(truth.t) + at.angle_deg * kDegree * reach_m;
            const double from_us = thread_microseconds();
            const auto e = icp.align(points, motion, start, search_m);
            const double took_us = thread_microseconds() - from_us;
            const auto known = icp.align(points, motion, truth);
            if (progress) progress(++done, all);
            sums.points += static_cast<double>(points.size());
            if (!e || !known) {
                ++run.told;
                continue;
            }
            sums.microseconds.push_back(took_us);
            sums.iterations += e->iterations;
            const Vector6 error = error_between(e->T_lidar_target, truth);
            if (!(normalised_error_squared(error, known->bound) < kFoundSigma * kFoundSigma)) {
                run.told += !e->credible;
                continue;
            }
            ++run.found;
            if (e->observability.unobserved > 0)
                ++run.unobserved;
            else
                sums.add(*e, truth);
        }
        sums.put_into(run);
        runs.push_back(std::move(run));
    }
    return runs;
}

}  // namespace narpa
