/// tests/estimator/filter/filter_flight.h - simulated truth, chaser and sensors for the tests of the filter.
#pragma once

#include <Eigen/Cholesky>
#include <random>
#include <vector>

#include "base/constants.h"
#include "estimator/filter/pose_filter.h"
#include "tests/support/shapes.h"

namespace narpa::test {

inline constexpr std::int64_t kSecond = 1'000'000'000;

inline double normal(std::mt19937_64& random) {
    return std::normal_distribution<double>()(random);
}
template <int N>
Eigen::Matrix<double, N, 1> draw(const Eigen::Matrix<double, N, N>& covariance, std::mt19937_64& random) {
    Eigen::Matrix<double, N, 1> white;
    for (int i = 0; i < N; ++i) white[i] = normal(random);
    return Eigen::LLT<Eigen::Matrix<double, N, N>>(covariance).matrixL() * white;
}

/// A camera measures range ten times less well than direction, and tilt goes with sideways.
inline Matrix6 camera_like() {
    Matrix6 L = Matrix6::Zero();
    L.diagonal() << 8e-3, 8e-3, 3e-3, 4e-3, 4e-3, 6e-2;
    L(3, 1) = 3e-3;
    L(4, 0) = -3e-3;
    return L * L.transpose();
}
inline Matrix6 lidar_like() {
    Matrix6 L = Matrix6::Zero();
    L.diagonal() << 5e-4, 7e-4, 1e-3, 2e-3, 1e-3, 1.5e-3;
    L(5, 0) = 8e-4;
    return L * L.transpose();
}

/// Moves the truth on by its own small steps: Euler and impulses, nothing of the filter's.
inline void live(const MotionModel& model, double dt_s, RelativeState& s, std::mt19937_64& random) {
    constexpr int kSteps = 20;
    const double h = dt_s / kSteps, n = model.orbit_rate_rad_s;
    const auto kick = [&](double psd) {
        return std::sqrt(psd * h) * Vec3{normal(random), normal(random), normal(random)};
    };
    const auto euler = [&](const Vec3& w) {
        if (!model.inertia_kg_m2) return Vec3{};
        const Vec3 momentum = to_vec3(*model.inertia_kg_m2 * to_eigen(w));
        return to_vec3(model.inertia_kg_m2->ldlt().solve(to_eigen(cross(momentum, w))));
    };
    for (int i = 0; i < kSteps; ++i) {
        const auto gravity = [&](const Vec3& r, const Vec3& v) {
            return Vec3{3 * n * n * r.x + 2 * n * v.y, -2 * n * v.x, -n * n * r.z};
        };
        const Vec3 v_middle = s.velocity_m_s + 0.5 * h * gravity(s.position_m, s.velocity_m_s);
        const Vec3 r_middle = s.position_m + 0.5 * h * s.velocity_m_s;
        const Vec3 jolt = kick(model.acceleration_psd);
        s.position_m += h * (v_middle + 0.5 * jolt);
        s.velocity_m_s += h * gravity(r_middle, v_middle) + jolt;
        const Vec3 twist = kick(model.angular_acceleration_psd);
        const Vec3 w_middle = s.rate_rad_s + 0.5 * h * euler(s.rate_rad_s);
        s.q_frame_target = normalized(exp_rotation({0, 0, -n * h}) * s.q_frame_target *
                                      exp_rotation(h * (w_middle + 0.5 * twist)));
        s.rate_rad_s += h * euler(w_middle) + twist;
    }
}

struct Case {
    const char* name;
    MotionModel motion;
    Matrix6 sensor;
};
inline std::vector<Case> cases() {
    MotionModel free, orbit, rigid;
    free.acceleration_psd = orbit.acceleration_psd = rigid.acceleration_psd = 1e-8;
    free.angular_acceleration_psd = orbit.angular_acceleration_psd = rigid.angular_acceleration_psd = 1e-10;
    orbit.orbit_rate_rad_s = 1.13e-3;
    rigid.inertia_kg_m2 = Eigen::Vector3d(900, 600, 350).asDiagonal();
    MotionModel both = rigid;
    both.orbit_rate_rad_s = orbit.orbit_rate_rad_s;
    return {{"free, camera", free, camera_like()},
            {"free, lidar", free, lidar_like()},
            {"orbit, camera", orbit, camera_like()},
            {"orbit, lidar", orbit, lidar_like()},
            {"tumbling, camera", rigid, camera_like()},
            {"tumbling, lidar", rigid, lidar_like()},
            {"orbit, tumbling, camera", both, camera_like()},
            {"orbit, tumbling, lidar", both, lidar_like()}};
}

/// One run: truth, chaser, sensor.
class Flight {
public:
    Flight(const Case& c, std::uint64_t seed) : case_(c), random_(seed) {
        P0_.setZero();
        P0_.diagonal() << 0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6;
        truth.position_m = {1.0, 30.0, -2.0};
        truth.velocity_m_s = {0.02, -0.3, 0.01};
        truth.rate_rad_s = {0.03, -0.02, 0.01};
        // The attitude begins half a turn from the sensor's, and keeps going through it.
        const Vec3 axis = random_direction(random_);
        truth.q_frame_target = normalized(sensor_attitude(0) * exp_rotation(kPi * axis));
    }
    [[nodiscard]] RelativeState first_guess() { return displaced(truth, -draw<12>(P0_, random_)); }
    [[nodiscard]] const Matrix12& first_covariance() const { return P0_; }

    [[nodiscard]] PoseMeasurement measure(std::int64_t t_ns) {
        PoseMeasurement m;
        m.t_ns = t_ns;
        m.covariance = case_.sensor;
        m.T_chaser_sensor = mount_;
        m.q_frame_chaser = chaser_attitude(t_ns);
        const Quat inertial = conjugate(m.q_frame_chaser);
        const Rigid3 T = inverse(mount_) * Rigid3{inertial * truth.q_frame_target, inertial * truth.position_m};
        m.T_sensor_target = displaced(T, draw<6>(case_.sensor, random_));
        if (random_() % 2 != 0) m.T_sensor_target.q = -m.T_sensor_target.q;
        return m;
    }
    void live_on(double dt_s) { live(case_.motion, dt_s, truth, random_); }

    RelativeState truth;

    [[nodiscard]] static Quat chaser_attitude(std::int64_t t_ns) {
        return exp_rotation(1e-9 * static_cast<double>(t_ns) * Vec3{0.01, 0.002, -0.005}) *
               normalized(Quat{0.5, 0.1, -0.7, 0.4});
    }

private:
    [[nodiscard]] Quat sensor_attitude(std::int64_t t_ns) const { return chaser_attitude(t_ns) * mount_.q; }

    const Case& case_;
    std::mt19937_64 random_;
    Matrix12 P0_;
    Rigid3 mount_{normalized(Quat{0.9, -0.2, 0.3, 0.1}), {0.4, -0.2, 1.0}};
};

}  // namespace narpa::test
