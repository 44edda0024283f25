#include "bench/estimation/filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "base/constants.h"
#include "base/time.h"
#include "bench/statistics.h"

namespace narpa {
namespace {

Matrix6 camera_covariance() {
    Vector6 sigma;
    sigma << 8e-3, 8e-3, 3e-3, 5e-3, 5e-3, 6e-2;
    Matrix6 C = sigma.cwiseAbs2().asDiagonal();
    C(3, 1) = C(1, 3) = 0.6 * sigma[1] * sigma[3];
    C(4, 0) = C(0, 4) = -0.6 * sigma[0] * sigma[4];
    return C;
}
Matrix6 lidar_covariance() {
    Vector6 sigma;
    sigma << 5e-4, 7e-4, 1e-3, 2e-3, 1e-3, 1.5e-3;
    return sigma.cwiseAbs2().asDiagonal();
}

class Flight {
public:
    Flight(const FilterCase& what, std::uint64_t seed) : case_(what), random_(seed) {
        truth_.position_m = {1, 30, -2};
        truth_.velocity_m_s = {0.02, -0.3, 0.01};
        truth_.rate_rad_s = {0.03, -0.02, 0.01};
        const Vec3 axis = normalized(Vec3{normal(), normal(), normal()});
        truth_.q_frame_target = normalized(attitude(0) * mount_.q * exp_rotation(kPi * axis));
        covariance_.setZero();
        covariance_.diagonal() << 0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6;
    }
    [[nodiscard]] const RelativeState& truth() const { return truth_; }
    [[nodiscard]] const Matrix12& first_covariance() const { return covariance_; }
    [[nodiscard]] RelativeState first_guess() { return displaced(truth_, draw<kFilterStates>(covariance_)); }
    [[nodiscard]] PoseMeasurement measure(std::int64_t t_ns, const Matrix6& covariance) {
        PoseMeasurement m{t_ns, {}, covariance, mount_, attitude(t_ns)};
        const Quat q = conjugate(m.q_frame_chaser);
        const Rigid3 T_chaser_target{q * truth_.q_frame_target, q * truth_.position_m};
        m.T_sensor_target = displaced(inverse(mount_) * T_chaser_target, draw<6>(covariance));
        return m;
    }
    /// In steps so short that one impulse of noise in the middle of each approximates white noise.
    void one_second() {
        constexpr int kParts = 10;
        MotionModel quiet = case_.motion;
        quiet.acceleration_psd = quiet.angular_acceleration_psd = 0;
        Matrix12 unused = Matrix12::Identity();
        for (int i = 0; i < kParts; ++i) {
            propagate(quiet, 0.5 / kParts, {}, truth_, unused);
            truth_.velocity_m_s += kick(case_.motion.acceleration_psd / kParts);
            truth_.rate_rad_s += kick(case_.motion.angular_acceleration_psd / kParts);
            propagate(quiet, 0.5 / kParts, {}, truth_, unused);
        }
    }

private:
    double normal() { return std::normal_distribution<double>()(random_); }
    Vec3 kick(double variance) { return std::sqrt(variance) * Vec3{normal(), normal(), normal()}; }
    template <int N>
    Eigen::Matrix<double, N, 1> draw(const Eigen::Matrix<double, N, N>& covariance) {
        Eigen::Matrix<double, N, 1> white;
        for (int i = 0; i < N; ++i) white[i] = normal();
        return Eigen::LLT<Eigen::Matrix<double, N, N>>(covariance).matrixL() * white;
    }
    [[nodiscard]] static Quat attitude(std::int64_t t_ns) {
        return exp_rotation(1e-9 * static_cast<double>(t_ns) * Vec3{0.01, 0.002, -0.005}) *
               normalized(Quat{0.5, 0.1, -0.7, 0.4});
    }

    const FilterCase& case_;
    std::mt19937_64 random_;
    RelativeState truth_;
    Matrix12 covariance_;
    Rigid3 mount_{normalized(Quat{0.9, -0.2, 0.3, 0.1}), {0.4, -0.2, 1.0}};
};

/// Sums over the runs, each second.
void add(const PoseFilter& filter, const RelativeState& truth, FilterTime& time) {
    const Vector12 e = error_between(filter.state(), truth);
    time.nees += normalised_error_squared(e, filter.covariance());
    time.position_rms_m += e.head<3>().squaredNorm();
    time.attitude_rms_rad += e.segment<3>(6).squaredNorm();
    const Vector12 variance = filter.covariance().diagonal();
    time.position_sigma_m += variance.head<3>().sum();
    time.attitude_sigma_rad += variance.segment<3>(6).sum();
}

class CaseRun {
public:
    CaseRun(const FilterCase& what, const FilterBenchSettings& settings) : case_(what), settings_(settings) {
        out_.name = what.name;
        out_.runs = settings.runs;
        out_.times.resize(static_cast<std::size_t>(settings.seconds));
    }
    void fly(std::uint64_t seed) {
        Flight flight(case_, seed);
        PoseFilter filter = *PoseFilter::create({case_.motion}, 0, flight.first_guess(), flight.first_covariance());
        const auto late_ns = static_cast<std::int64_t>(1e9 * case_.lidar_late_s);
        for (int s = 0; s < settings_.seconds; ++s) {
            const std::int64_t t_ns = s * kSecond_ns;
            if (case_.camera) take(filter, flight.measure(t_ns, camera_covariance()));
            if (case_.lidar) {
                const PoseMeasurement m = flight.measure(t_ns, lidar_covariance());
                if (late_ns > 0) filter.predict(t_ns + late_ns);
                take(filter, m);
            }
            // Estimate and truth are compared at the same time, after all measurements up to it.
            if (late_ns == 0) add(filter, flight.truth(), out_.times[static_cast<std::size_t>(s)]);
            flight.one_second();
            if (late_ns > 0) {
                filter.predict(t_ns + kSecond_ns);
                add(filter, flight.truth(), out_.times[static_cast<std::size_t>(s)]);
            }
        }
        out_.gated += filter.counts().gated;
    }
    FilterRun done() {
        for (std::size_t s = 0; s < out_.times.size(); ++s) {
            FilterTime& t = out_.times[s];
            t.t_s = static_cast<double>(s) + (case_.lidar_late_s > 0 ? 1 : 0);
            t.nees /= out_.runs;
            for (double* v : {&t.position_rms_m, &t.position_sigma_m, &t.attitude_rms_rad, &t.attitude_sigma_rad})
                *v = std::sqrt(*v / out_.runs);
        }
        out_.nis /= static_cast<double>(out_.updates);
        out_.update_microseconds /= static_cast<double>(out_.updates);
        return out_;
    }

private:
    void take(PoseFilter& filter, const PoseMeasurement& m) {
        const double from_s = cpu_s(CLOCK_THREAD_CPUTIME_ID);
        out_.nis += filter.update(m).nis;
        out_.update_microseconds += 1e6 * (cpu_s(CLOCK_THREAD_CPUTIME_ID) - from_s);
        ++out_.updates;
    }

    const FilterCase& case_;
    const FilterBenchSettings& settings_;
    FilterRun out_;
};

}  // namespace

std::vector<FilterCase> filter_cases() {
    MotionModel free, orbit;
    orbit.orbit_rate_rad_s = 1.13e-3;  // 400 km above the Earth
    MotionModel tumbling = orbit;
    tumbling.inertia_kg_m2 = Eigen::Vector3d(900, 600, 350).asDiagonal();
    return {{"free, camera", free, true, false, 0},
            {"free, LiDAR", free, false, true, 0},
            {"orbit, camera", orbit, true, false, 0},
            {"orbit, LiDAR", orbit, false, true, 0},
            {"orbit, tumbling, camera and late LiDAR", tumbling, true, true, 0.3}};
}

double FilterRun::band() const {
    return 1.96 * std::sqrt(2.0 * kFilterStates / runs);
}
double FilterRun::nees() const {
    double sum = 0;
    for (const FilterTime& t : times) sum += t.nees;
    return sum / static_cast<double>(times.size());
}
double FilterRun::inside_band() const {
    const auto inside = std::count_if(times.begin(), times.end(), [this](const FilterTime& t) {
        return std::abs(t.nees - kFilterStates) < band();
    });
    return static_cast<double>(inside) / static_cast<double>(times.size());
}

std::vector<FilterRun> run_filter(const std::vector<FilterCase>& cases, const FilterBenchSettings& settings) {
    std::vector<FilterRun> runs;
    std::uint64_t flight = 1'000'003;
    for (const FilterCase& what : cases) {
        CaseRun run(what, settings);
        for (int i = 0; i < settings.runs; ++i) run.fly(++flight);
        runs.push_back(run.done());
    }
    return runs;
}

}  // namespace narpa
