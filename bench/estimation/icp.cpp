#include "bench/estimation/icp.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "bench/statistics.h"
#include "estimator/cloud/cloud_icp.h"
#include "protocols/lidar/velodyne.h"

namespace narpa {
namespace {

/// Found: within this many standard deviations of the bound at the truth. Other minima are hundreds of them away.
constexpr double kFoundSigma = 10;

/// Largest angle between the target's x axis and the direction to the LiDAR.
constexpr double kCone_deg = 20;
/// Largest velocity and rate of the target during the sweep, on each axis.
constexpr double kVelocity_m_s = 0.1, kRate_rad_s = 0.02;
constexpr double kRotation_hz = 10, kRangeMax_m = 100;
constexpr double kRangeNoise_m = 0.02;  ///< before the LiDAR model rounds the ranges

class Sweeps {
public:
    Sweeps(const World& world, std::size_t target, std::uint64_t stream)
        : world_(world),
          target_(target),
          random_(1'000'003 + stream),
          placement_(world.scene().bodies.size()),
          shots_(model_.spec().shots_per_packet),
          echoes_(shots_.size()),
          bytes_(model_.spec().data_packet_bytes) {}

    [[nodiscard]] double uniform(double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    [[nodiscard]] double normal() { return std::normal_distribution<double>()(random_); }
    [[nodiscard]] Vec3 direction() { return normalized(Vec3{normal(), normal(), normal()}); }

    /// The target's x axis points back at the LiDAR, within the cone; any roll; slightly off the LiDAR's y axis.
    [[nodiscard]] Rigid3 pose() {
        const double distance = uniform(kIcpDistanceMin_m, kIcpDistanceMax_m);
        const Vec3 aim = normalized(Vec3{uniform(-0.05, 0.05), 1, uniform(-0.05, 0.05)});
        const double off = std::acos(uniform(std::cos(kCone_deg * kDegree), 1));
        const Vec3 x = -aim, side = normalized(cross(x, direction())), up = cross(x, side);
        const Vec3 axis = std::cos(off) * x + std::sin(off) * side;
        const Vec3 y = normalized(cross(up, axis));
        return {exp_rotation(uniform(-3.14, 3.14) * axis) * quat_from_columns(axis, y, cross(axis, y)),
                distance * aim};
    }
    [[nodiscard]] ApparentMotion motion() {
        const auto within = [&](double most) {
            return Vec3{uniform(-most, most), uniform(-most, most), uniform(-most, most)};
        };
        return {within(kVelocity_m_s), within(kRate_rad_s)};
    }
    [[nodiscard]] Rigid3 start_near(const Rigid3& T, const IcpStarts& starts) {
        return displaced(
            T, random_error(starts.start_angle_deg * kDegree, starts.start_distance_fraction * norm(T.t), random_));
    }

    /// One turn, from behind to behind. The pose is valid at its middle, when the rotor points forward. Points pass
    /// through the model's packets.
    void scan(const Rigid3& T_lidar_target, const ApparentMotion& motion, LidarSweep& out) {
        const auto turn_ns = static_cast<std::int64_t>(1e9 / kRotation_hz);
        out.clear();
        const std::int64_t period_ns = model_.spec().packet_period_ns;
        const std::int64_t first = turn_ns / 2 / period_ns, last = 3 * turn_ns / 2 / period_ns;
        Vector6 rate;
        rate << to_eigen(motion.rate_rad_s), to_eigen(motion.velocity_m_s);
        for (std::int64_t packet = first; packet < last; ++packet) {
            model_.shots(packet, shots_);
            const std::int64_t after_ns = packet * period_ns - turn_ns;
            for (std::size_t i = 0; i < shots_.size(); ++i) {
                const double t_s = 1e-9 * static_cast<double>(after_ns + shots_[i].t_offset_ns);
                placement_.set(target_, displaced(T_lidar_target, t_s * rate));
                echoes_[i].strongest.range_m = range_of({shots_[i].origin_m, shots_[i].direction});
            }
            model_.encode(packet, 0, echoes_, bytes_);
            reader_.append(bytes_, after_ns, out);
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
        if (hits.met == 0 || hits.range_m[0] > kRangeMax_m) return 0;
        return std::max(0.0, hits.range_m[0] + kRangeNoise_m * normal());
    }

    const World& world_;
    std::size_t target_;
    std::shared_ptr<const LidarModel> unit_ = vlp16().configure({.rate_hz = kRotation_hz});
    const LidarModel& model_ = *unit_;
    std::mt19937_64 random_;
    BodyPoses placement_;
    std::vector<LidarShot> shots_;
    std::vector<LidarEchoes> echoes_;
    std::vector<std::uint8_t> bytes_;
    SweepReader reader_{model_};
};

/// Over the starts of one run.
struct Sums {
    Mean rotation_rad, translation_m, rotation_to_bound, translation_to_bound, nees, points, iterations;
    std::vector<double> microseconds;

    void add(const CloudEstimate& e, const Rigid3& truth) {
        const Vector6 error = error_between(e.T_lidar_target, truth);
        const Vector6 to_bound = error.cwiseAbs2().cwiseQuotient(e.bound.diagonal());
        rotation_rad.add(error.head<3>().norm());
        translation_m.add(error.tail<3>().norm());
        rotation_to_bound.add(std::sqrt(to_bound.head<3>().mean()));
        translation_to_bound.add(std::sqrt(to_bound.tail<3>().mean()));
        nees.add(normalised_error_squared(error, e.covariance));
    }
    void put_into(IcpRun& run) const {
        run.rotation_rms_deg = rotation_rad.rms() / kDegree;
        run.translation_rms_m = translation_m.rms();
        run.rotation_to_bound = rotation_to_bound.rms();
        run.translation_to_bound = translation_to_bound.rms();
        run.nees = nees.mean();
        run.points = points.mean();
        run.iterations = iterations.mean();
        run.microseconds_p50 = quantile(microseconds, 0.5);
        run.microseconds_p99 = quantile(microseconds, 0.99);
    }
};

}  // namespace

std::vector<IcpRun> run_icp(const World& world, std::size_t target, const std::vector<IcpStarts>& starts,
                            const std::function<void(int, int)>& progress) {
    IcpSettings settings;
    settings.noise.range_m =
        std::hypot(kRangeNoise_m, vlp16().configure_default()->spec().range_resolution_m / std::sqrt(12.0));
    Lidar lidar;
    lidar.range_max_m = kRangeMax_m;
    settings.certain = certain_return_of(lidar, world.scene());
    CloudIcp icp(world.tracer(), target, settings);

    int done = 0, all = 0;
    for (const IcpStarts& at : starts) all += at.starts;
    std::vector<IcpRun> runs;
    LidarSweep sweep;
    for (const IcpStarts& at : starts) {
        Sweeps sweeps(world, target, runs.size());
        IcpRun run{at};
        Sums sums;
        for (int i = 0; i < at.starts; ++i) {
            const Rigid3 truth = sweeps.pose();
            const ApparentMotion motion = sweeps.motion();
            sweeps.scan(truth, motion, sweep);
            const Rigid3 start = sweeps.start_near(truth, at);
            const double reach_m = world.tracer().bounding_radius_m(target);
            const double search_m =
                at.start_distance_fraction * norm(truth.t) + at.start_angle_deg * kDegree * reach_m;
            const double from_s = cpu_s(CLOCK_THREAD_CPUTIME_ID);
            const auto e = icp.align(sweep.points, motion, start, search_m, sweep.empty);
            const double took_s = cpu_s(CLOCK_THREAD_CPUTIME_ID) - from_s;
            const auto known = icp.align(sweep.points, motion, truth);
            progress(++done, all);
            sums.points.add(static_cast<double>(sweep.points.size()));
            if (!e || !known) {
                ++run.told;
                continue;
            }
            sums.microseconds.push_back(1e6 * took_s);
            sums.iterations.add(e->iterations);
            const Vector6 error = error_between(e->T_lidar_target, truth);
            if (!(normalised_error_squared(error, known->bound) < kFoundSigma * kFoundSigma)) {
                run.told += !e->answer.usable();
                continue;
            }
            ++run.found;
            if (e->observability.unobserved > 0)
                ++run.unobserved;
            else
                sums.add(*e, truth);
        }
        sums.put_into(run);
        runs.push_back(run);
    }
    return runs;
}

}  // namespace narpa
