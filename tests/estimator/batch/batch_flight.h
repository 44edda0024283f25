/// tests/estimator/batch/batch_flight.h - a simulated flight whose model is wrong by known amounts: points in
/// frames and returns in sweeps, with noise.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "estimator/batch/batch_solver.h"
#include "renderer/projection/brown_conrady.h"
#include "tests/support/shapes.h"

namespace narpa::test {

/// A target that tumbles and drifts before a chaser; both move freely. Camera axes = chaser axes but for the mount;
/// the LiDAR's optical axis is its y.
class BatchFlight {
public:
    int frames = 0, sweeps = 0;
    double step_s = 2;         ///< between frames, and between sweeps, which lie in the middle
    double pixel_noise = 0.2;  ///< 0: none; the same is stated, or 0.1
    double range_noise_m = 0.02;
    bool turns = true;      ///< the chaser
    BatchValues truth{};    ///< the change from the model to the truth
    double outliers = 0;    ///< part of the points
    int per_cluster = 1;    ///< so many points lie close together and have one error
    bool is_stated = true;  ///< that clusters have one error

    [[nodiscard]] BatchInput input(const Tracer& model, std::mt19937_64& random) const {
        BatchInput in;
        in.camera = std::make_shared<Pinhole>(800, 800, 319.5, 239.5);
        in.T_chaser_camera = {exp_rotation({0.02, -0.03, 0.01}), {0.1, 0.05, 0}};
        in.T_chaser_lidar = {exp_rotation({0.5 * kPi, 0, 0}), {0.1, 0.05, 0}};  // lidar x, y, z = chaser x, z, -y
        in.tracer = &model;
        in.noise = {range_noise_m, 1e-4};
        const std::vector<Vec3> points = body_points(random);
        for (int k = 0; k < frames; ++k) in.frames.push_back(frame(in, step_s * k, points, random));
        for (int k = 0; k < sweeps; ++k) in.sweeps.push_back(sweep(in, step_s * (k + 0.5), model, random));
        return in;
    }

    /// The target at this time, for a chaser of this attitude.
    [[nodiscard]] Rigid3 T_chaser_target(double t_s) const {
        const RelativeState s = state(t_s);
        const Quat q = conjugate(chaser(t_s));
        return {normalized(q * s.q_frame_target), q * s.position_m};
    }
    [[nodiscard]] RelativeState state(double t_s) const {
        const Vec3 rate{0.012, 0.02, -0.015};
        return {Vec3{0.4, -0.3, 14} + t_s * Vec3{-0.01, 0.008, -0.09},
                {-0.01, 0.008, -0.09},
                normalized(exp_rotation({0.3, 0.2, 0.5}) * exp_rotation(t_s * rate)),
                rate};
    }

private:
    [[nodiscard]] Vec3 chaser_rate() const { return turns ? Vec3{0.004, -0.003, 0.005} : Vec3{}; }
    [[nodiscard]] Quat chaser(double t_s) const { return exp_rotation(t_s * chaser_rate()); }
    [[nodiscard]] BatchTime time(double t_s) const {
        return {std::llround(1e9 * t_s), chaser(t_s), chaser_rate(), T_chaser_target(t_s)};
    }
    /// T_sensor_target at the true time of a measurement with this stamp, and by the model's mount.
    [[nodiscard]] Rigid3 seen(const Rigid3& T_chaser_sensor, BatchUnknown rotation, BatchUnknown shift,
                              double t_s) const {
        Rigid3 T = T_chaser_sensor;
        T.q = T.q * exp_rotation(vector_at(truth, rotation));
        T.t = T.t + vector_at(truth, shift);
        return inverse(T) * T_chaser_target(t_s);
    }
    [[nodiscard]] double late_s(bool is_sweep) const {
        return is_sweep || sweeps == 0 ? at(truth, BatchUnknown::clock) : 0;
    }

    [[nodiscard]] std::vector<Vec3> body_points(std::mt19937_64& random) const {
        std::uniform_real_distribution<double> u(-1.8, 1.8), close(-0.002, 0.002);
        std::vector<Vec3> points;
        for (int i = 0; i < 40; ++i) {
            const Vec3 centre{u(random), u(random), u(random)};
            for (int k = 0; k < per_cluster; ++k)
                points.push_back(centre + Vec3{close(random), close(random), close(random)});
        }
        return points;
    }

    [[nodiscard]] BatchFrame frame(const BatchInput& in, double t_s, const std::vector<Vec3>& points,
                                   std::mt19937_64& random) const {
        std::normal_distribution<double> normal;
        std::uniform_real_distribution<double> u;
        const Rigid3 T =
            seen(in.T_chaser_camera, BatchUnknown::camera_rx, BatchUnknown::camera_x, t_s - late_s(false));
        const double f = 800 * (1 + at(truth, BatchUnknown::focal));
        const BrownConrady camera(
            {f, f * (1 + at(truth, BatchUnknown::aspect)), 319.5 + at(truth, BatchUnknown::centre_x),
             239.5 + at(truth, BatchUnknown::centre_y)},
            std::vector{at(truth, BatchUnknown::k1), at(truth, BatchUnknown::k2), at(truth, BatchUnknown::p1),
                        at(truth, BatchUnknown::p2), at(truth, BatchUnknown::k3)});
        BatchFrame out{time(t_s), inverse(in.T_chaser_camera) * T_chaser_target(t_s), {}, {}};
        const double stated = pixel_noise > 0 ? pixel_noise : 0.1;
        Pixel error{};
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (i % static_cast<std::size_t>(per_cluster) == 0)
                error = {pixel_noise * normal(random), pixel_noise * normal(random)};
            const auto image = camera.project(T * ((1 + at(truth, BatchUnknown::scale)) * points[i]));
            if (!image) continue;
            const bool wrong = u(random) < outliers;
            out.points.body_m.push_back(points[i]);
            out.points.seen.push_back({image->x + error.u + (wrong ? 30 : 0), image->y + error.v});
            out.points.noise.push_back({0.5 * stated * stated, 0, 0.5 * stated * stated});
            out.points.beyond.push_back({1, 0, 1});
            out.points.numbers.push_back(2);
        }
        if (per_cluster > 1 && is_stated) out.points.window_px = 21;
        return out;
    }

    /// Lines 0.4 degrees apart, as a LiDAR with x right, y forward sees the target.
    [[nodiscard]] BatchSweep sweep(const BatchInput& in, double t_s, const Tracer& model,
                                   std::mt19937_64& random) const {
        std::normal_distribution<double> normal;
        const Rigid3 T = seen(in.T_chaser_lidar, BatchUnknown::lidar_rx, BatchUnknown::lidar_x, t_s - late_s(true));
        BatchSweep out{time(t_s), inverse(in.T_chaser_lidar) * T_chaser_target(t_s), {}};
        // A target that is larger by a factor is seen as one that is as much nearer, at ranges as much longer.
        const double size = 1 + at(truth, BatchUnknown::scale);
        BodyPoses at_pose(1);
        at_pose.set(0, {T.q, T.t / size});
        for (int column = -40; column <= 40; ++column)
            for (int line = -25; line <= 25; ++line) {
                const double a = 0.5 * kRadPerDeg * column, w = 0.8 * kRadPerDeg * line;
                const Vec3 aim{std::cos(w) * std::sin(a), std::cos(w) * std::cos(a), std::sin(w)};
                const Vec3 off{normal(random), normal(random), normal(random)};
                const Hit hit = model.intersect(at_pose, {{}, normalized(aim + in.noise.pointing_rad * off)}, 200);
                if (hit.body < 0) continue;
                out.returns.points.push_back(
                    {{},
                     aim,
                     size * hit.range_m + range_noise_m * normal(random) + at(truth, BatchUnknown::range_bias),
                     0});
            }
        return out;
    }
};

/// A body without symmetry: boxes at odd angles.
inline Scene batch_scene() {
    Mesh m;
    m.name = "craft";
    const auto append = [&](const Mesh& part, const Rigid3& T) {
        const auto first = static_cast<std::uint32_t>(m.positions.size());
        for (const Vec3f& p : part.positions) m.positions.push_back(vec_cast<float>(T * vec_cast<double>(p)));
        for (const auto& f : part.faces) m.faces.push_back({first + f[0], first + f[1], first + f[2]});
    };
    append(box(3, 2, 2), {});
    append(box(1.5, 5, 0.1), {exp_rotation({0, 0.4, 0}), {0.3, 3.8, 0}});
    append(box(1.5, 3, 0.1), {exp_rotation({0, -0.3, 0}), {-0.2, -2.7, 0.2}});
    append(box(0.1, 1.6, 1.6), {exp_rotation({0, 0.5, 0.4}), {1.9, 0.3, 0.8}});
    append(box(0.3, 0.3, 2.5), {{}, {-1.0, 0.6, 2.0}});
    m.face_material.assign(m.faces.size(), 0);
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    add_mesh(scene, std::move(m));
    return scene;
}
inline const Tracer& batch_tracer() {
    static const Scene scene = batch_scene();
    static const Tracer tracer = *Tracer::create(scene, 1);
    return tracer;
}

/// Priors of these unknowns alone, in their default widths.
inline BatchValues priors_of(std::initializer_list<BatchUnknown> unknowns) {
    BatchValues sigma{};
    for (const BatchUnknown u : unknowns) {
        const BatchUnknownRow& row = batch_unknowns()[static_cast<std::size_t>(u)];
        at(sigma, u) = row.unit * row.default_sigma;
    }
    return sigma;
}
inline const BatchEstimate& of(const BatchResult& r, BatchUnknown u) {
    return *std::ranges::find(r.unknowns, u, &BatchEstimate::unknown);
}
/// e' P^-1 e of all unknowns.
inline double unknowns_nees(const BatchResult& r, const BatchValues& truth) {
    const auto n = static_cast<Eigen::Index>(r.unknowns.size());
    Eigen::VectorXd e(n), s(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const BatchEstimate& u = r.unknowns[static_cast<std::size_t>(i)];
        s[i] = 1 / u.sigma, e[i] = s[i] * (u.value - at(truth, u.unknown));
    }
    const Eigen::MatrixXd correlation = s.asDiagonal() * r.covariance * s.asDiagonal();
    return e.dot(correlation.ldlt().solve(e));
}

}  // namespace narpa::test
