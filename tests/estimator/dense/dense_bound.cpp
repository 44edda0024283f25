// Dense estimates against the bound, and the normal equations against closed forms.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <random>

#include "estimator/dense/dense_alignment.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "renderer/geometry/ellipsoid.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

/// Images whose model is linear in the pose, with a signal and a derivative in every pixel.
struct LinearModel {
    static constexpr int kSize = 24;
    std::vector<float> signal, measured;
    std::vector<PixelDerivative> derivative;
    SensorModel sensor;

    explicit LinearModel(std::mt19937_64& random) {
        std::normal_distribution<float> normal;
        sensor.read_dn2 = 4;
        sensor.shot_dn = 0.1;
        sensor.black_dn = 10;
        sensor.top_dn = 1e6;
        for (int p = 0; p < kSize * kSize; ++p) {
            signal.push_back(100 + 30 * normal(random));
            derivative.emplace_back();
            for (int k = 0; k < 6; ++k) derivative.back()[k] = 20 * normal(random);
        }
    }
    [[nodiscard]] double variance(std::size_t p) const {
        return sensor.variance_dn2(sensor.black_dn + static_cast<double>(signal[p]));
    }
    void measure(const Vector6& off, const Exposure& e, double noise_times, std::mt19937_64& random) {
        std::normal_distribution<double> normal;
        measured.clear();
        for (std::size_t p = 0; p < signal.size(); ++p) {
            const double expected = static_cast<double>(signal[p]) + derivative[p].cast<double>().dot(off);
            measured.push_back(static_cast<float>(sensor.black_dn + e.gain * expected + e.offset_dn +
                                                  noise_times * std::sqrt(variance(p)) * normal(random)));
        }
    }
    [[nodiscard]] PhotometricImages images(const ExposurePrior& prior = {}) const {
        return {kSize, kSize, sensor, measured, {}, signal, {}, derivative, 1, prior};
    }
};

TEST(PhotometricFit, FindsThePoseWhateverTheExposure) {
    std::mt19937_64 random(3);
    LinearModel model(random);
    Vector6 off;
    off << 0.01, -0.02, 0.005, 0.03, -0.01, 0.02;
    const Exposure exposed{1.04, 1.5};
    model.measure(off, exposed, 0, random);
    const ExposurePrior free{1e3, 1e3};
    Exposure e;
    Vector6 step = Vector6::Zero();
    for (int k = 0; k < 4; ++k) {  // gain times derivative: not quite linear
        const auto eq = equations(model.images(free), e, {1, 1e9, 0});
        step = eq.pose_information().ldlt().solve(eq.pose_gradient());
        const Eigen::Vector2d de = eq.exposure_step(step);
        e.gain += de[0];
        e.offset_dn += de[1];
    }
    EXPECT_LT((step - off).norm(), 1e-4 * off.norm());
    EXPECT_NEAR(e.gain, exposed.gain, 1e-5);
    EXPECT_NEAR(e.offset_dn, exposed.offset_dn, 1e-3);
}

TEST(PhotometricFit, EliminatesTheExposureAsTheWholeInverseDoes) {
    std::mt19937_64 random(4);
    LinearModel model(random);
    model.measure(Vector6::Zero(), {}, 1, random);
    const auto eq = equations(model.images(), {}, {});
    const Matrix6 whole = eq.information.inverse().topLeftCorner<6, 6>();
    EXPECT_LT((eq.pose_information() * whole - Matrix6::Identity()).norm(), 1e-9);
    // A known exposure gives more information on the pose.
    const auto known = equations(model.images({0, 0}), {}, {});
    const Matrix6 gained = known.pose_information() - eq.pose_information();
    EXPECT_GE((Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(gained).eigenvalues()[0]),
              -1e-9 * gained.norm());
    EXPECT_GT(gained.norm(), 0);
}

/// Also where the noise is three times what the sensor is said to have.
TEST(PhotometricFit, CovarianceIsThatOfErrors) {
    for (const double times : {1.0, 3.0}) {
        std::mt19937_64 random(5);
        LinearModel model(random);
        constexpr int kDraws = 400;
        double sum = 0;
        for (int n = 0; n < kDraws; ++n) {
            model.measure(Vector6::Zero(), {}, times, random);
            const auto eq = equations(model.images({0, 0}), {}, {1, 1e9, 0});
            const Vector6 step = eq.pose_information().ldlt().solve(eq.pose_gradient());
            sum += normalised_error_squared(step, eq.pose_covariance());
        }
        EXPECT_NEAR(sum / kDraws, 6, 4 * std::sqrt(12.0 / kDraws) + 0.3) << times;  // 484 pixels tell the scatter
    }
}

TEST(PhotometricFit, FindsTheShift) {
    std::mt19937_64 random(6);
    LinearModel model(random);
    constexpr int kSize = LinearModel::kSize;
    model.measured.assign(model.signal.size(), static_cast<float>(model.sensor.black_dn));
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x)
            if (x >= 3 && y < kSize - 2)
                model.measured[static_cast<std::size_t>(y * kSize + x)] +=
                    model.signal[static_cast<std::size_t>((y + 2) * kSize + x - 3)];
    EXPECT_EQ(best_shift(model.images(), 5), (std::array<int, 2>{3, -2}));
}

/// A shiny ellipsoid, 84 pixels long, through the detector's noise.
TEST(DenseBound, ErrorsOfNoiseReachTheBound) {
    Scene scene;
    scene.sun = Sun{normalized(Vec3{0.6, -0.3, -0.7}), 1361, 0};
    scene.ambient = {20, 20, 20};
    Material m;
    m.kind = &kinds::phong;
    m.diffuse = {0.2f, 0.2f, 0.2f};
    m.specular = {0.6f, 0.6f, 0.6f};
    m.exponent = 12;
    scene.materials.push_back(m);
    scene.bodies.push_back({"ball", exact_ellipsoid({1, 1.4, 0.8}), {}, {}});
    const auto render_scene = RenderScene::create(scene);
    ASSERT_TRUE(render_scene);
    Camera camera;
    camera.width = camera.height = 112;
    test::set_pinhole(camera, 300, 300, 55.5, 55.5);
    camera.format = PixelFormat::y16;
    camera.detector = Detector{.exposure_s = 3e-5,
                               .full_well_e = 13500,
                               .read_noise_e = 13,
                               .shot_noise = true,
                               .black_level_dn = 64,
                               .bits = 12};
    const BodyPoses at(1);
    const Rigid3 truth{normalized(Quat{0.9, 0.2, -0.3, 0.1}), {0.1, -0.05, 10}};
    ModelView view(*render_scene, camera, 0, at);
    FrameSettings fine;
    fine.seed = 99;
    fine.budget.kind = FrameBudget::Kind::rays;
    fine.budget.rays = 3'000'000;
    view.render(truth, fine, false);

    DenseAlignment dense(*render_scene, camera, 0);
    DenseOptions o;
    o.samples_per_pixel = 50;
    const auto bound = dense.bound(at, truth, o);
    ASSERT_TRUE(bound) << bound.error().text();
    constexpr int kFrames = 12;
    double to_bound = 0, to_covariance = 0;
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    for (int n = 0; n < kFrames; ++n) {
        expose(camera, view.radiance(), 7, static_cast<std::uint32_t>(n), bytes);
        const auto frame = measured_image(camera, bytes);
        ASSERT_TRUE(frame);
        Vector6 start;
        start << 0.03, -0.02, 0.02, 0.2, -0.1, 0.2;
        o.seed = static_cast<std::uint64_t>(n);
        const auto e = dense.align(*frame, at, displaced(truth, start), o);
        ASSERT_TRUE(e) << e.error().text();
        ASSERT_EQ(e->status, DenseStatus::converged) << name(e->status);
        const Vector6 error = error_between(truth, e->T_camera_body);
        to_bound += normalised_error_squared(error, *bound);
        to_covariance += normalised_error_squared(error, e->covariance);
    }
    const double ratio = std::sqrt(to_bound / (6 * kFrames));
    EXPECT_LT(ratio, 1.5);
    EXPECT_GT(ratio, 1 - 4 / std::sqrt(2.0 * 6 * kFrames)) << "better than can be";
    // The render's own noise is overestimated rather than underestimated.
    EXPECT_LT(to_covariance / kFrames, 6 + 4 * std::sqrt(12.0 / kFrames));
    EXPECT_GT(to_covariance / kFrames, 6.0 / 3);
}

}  // namespace
}  // namespace narpa
