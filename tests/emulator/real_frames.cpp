// A real frame: NEAR's MSI saw 433 Eros on 2000-02-25 from 363 km, with its published pose. The model is a mesh of
// 7790 plates and Lambert's law, the Sun's direction the published one. An answer is within what is told, or
// refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <sstream>

#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/view/frame_comparison.h"
#include "tests/support/cameras.h"
#include "tests/support/image_files.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

constexpr double kMetres_per_km = 1000;

/// Lines "v x y z" in km and "f a b c", counted from 0.
Mesh plate_model(const std::string& path) {
    Mesh m;
    m.name = "eros";
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        std::string kind;
        double a = 0, b = 0, c = 0;
        if (!(words >> kind >> a >> b >> c)) continue;
        if (kind == "v") m.positions.push_back(vec_cast<float>(kMetres_per_km * Vec3{a, b, c}));
        if (kind == "f")
            m.faces.push_back(
                {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(c)});
    }
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

class ErosFrame : public testing::Test {
protected:
    void SetUp() override {
        const std::string folder = test::source_path("../shared/assets");
        std::ifstream description(folder + "/pose/near_msi_eros/pose.json");
        if (!description) GTEST_SKIP() << "needs ../shared/assets/pose/near_msi_eros and smallbody/eros";
        const auto j = nlohmann::json::parse(description);
        const auto vector = [&](const nlohmann::json& v) { return Vec3{v[0], v[1], v[2]}; };
        const auto& rows = j["R_body_to_camera_rows_xright_ydown_zforward"];
        const Vec3 x = vector(rows[0]), y = vector(rows[1]), z = vector(rows[2]);
        const Quat q_body_camera = normalized(quat_from_columns(x, y, z));
        const Vec3 camera_m = kMetres_per_km * vector(j["camera_position_body_km"]);
        truth = inverse(Rigid3{q_body_camera, camera_m});
        scene.sun = Sun{normalized(vector(j["sun_direction_body"])), 1361, 0};
        Material rock;
        rock.diffuse = {0.25F, 0.25F, 0.25F};
        scene.materials.push_back(rock);
        scene.meshes.push_back(plate_model(folder + "/smallbody/eros/eros007790.tab"));
        ASSERT_EQ(scene.meshes[0].faces.size(), 7790U);
        Body body;
        body.name = "eros";
        body.shape = 0;
        scene.bodies.push_back(body);
        Camera camera;
        camera.width = j["width"], camera.height = j["height"];
        test::set_pinhole(camera, j["fx_px"], j["fy_px"], j["cx_px"], j["cy_px"]);
        camera.format = PixelFormat::y16;
        camera.detector =
            Detector{.exposure_s = 1e-4, .full_well_e = 40000, .read_noise_e = 30, .shot_noise = true, .bits = 12};
        scene.cameras.push_back(camera);
        render_scene.emplace(*RenderScene::create(scene));
        const cv::Mat image = test::read_image_file(folder + "/pose/near_msi_eros/" + std::string(j["image"]));
        ASSERT_EQ(image.type(), CV_16UC1);
        frame.width = image.cols, frame.height = image.rows;
        for (int v = 0; v < image.rows; ++v)
            for (int u = 0; u < image.cols; ++u) frame.dn.push_back(image.at<std::uint16_t>(v, u));
        counts = frame.dn;
        full_scale_if = j["image_scale_IF_per_65535"];
        calibrate();
    }
    /// The body's albedo is not known: the frame's brightest hundredth is scaled to the model's.
    void calibrate() {
        ModelView view(*render_scene, scene.cameras[0], 0, at);
        FrameSettings s;
        s.spp = 4;
        view.render(truth, s, false);
        const SensorModel sensor = sensor_model(scene.cameras[0]);
        std::vector<float> rendered;
        for (const Rgb& L : view.radiance().pixels)
            rendered.push_back(static_cast<float>(sensor.dn_per_radiance[0] * static_cast<double>(L.x) +
                                                  sensor.dn_per_radiance[1] * static_cast<double>(L.y) +
                                                  sensor.dn_per_radiance[2] * static_cast<double>(L.z)));
        const auto bright = [](std::vector<float> v) {
            const auto place = v.begin() + static_cast<std::ptrdiff_t>(v.size() * 99 / 100);
            std::nth_element(v.begin(), place, v.end());
            return *place;
        };
        const float gain = bright(rendered) / bright(frame.dn);
        for (float& dn : frame.dn) dn = static_cast<float>(sensor.black_dn) + gain * dn;
    }
    /// Of Li et al. 2004.
    void use_hapke(float albedo) {
        Material& rock = scene.materials[0];
        rock.kind = &kinds::hapke, rock.diffuse = {albedo, albedo, albedo};
        rock.hapke.phase_b = 0.25F, rock.hapke.phase_c = 1;
        rock.hapke.roughness_rad = 28 * static_cast<float>(kDegree);
        rock.hapke.opposition_b0 = 1.4F, rock.hapke.opposition_h = 0.01F;
    }
    Rigid3 off(std::mt19937_64& random) const {
        return displaced(truth, random_error(0.5 * kDegree, 0.005 * norm(truth.t), random));
    }
    /// A good answer is within six sigma of the published pose.
    void expect_honest(const Answer& answer, const Rigid3& T, const Matrix6& covariance, const char* method) {
        const Vector6 error = error_between(T, truth);
        const double nees = normalised_error_squared(error, covariance);
        RecordProperty(std::string(method) + std::to_string(answers++),
                       std::string(kAnswerKinds[static_cast<std::size_t>(answer.kind)]) + " " + answer.why +
                           ", off " + std::to_string(error.head<3>().norm() / kDegree) + " deg, " +
                           std::to_string(error.tail<3>().norm()) + " m, NEES " + std::to_string(nees) +
                           ", sigma " + std::to_string(rotation_sigma(covariance) / kDegree) + " deg, " +
                           std::to_string(position_sigma(covariance)) + " m");
        EXPECT_TRUE(answer.kind != AnswerKind::good || nees < 50) << method << ": NEES " << nees;
    }

    Scene scene;
    std::optional<RenderScene> render_scene;
    BodyPoses at{1};
    Rigid3 truth;
    MeasuredImage frame;
    std::vector<float> counts;  ///< of the image file
    double full_scale_if = 0;   ///< I/F that 65535 of them are
    int answers = 0;
    /// The plates are 300 m wide and approximate the surface, the pointing is known to about a pixel, Lambert's law
    /// is not the regolith's.
    ModelUncertainty told{.scale = 0.005,
                          .mesh_m = 100,
                          .albedo = 0.2,
                          .light_rad = 1 * kDegree,
                          .focal = 0.002,
                          .boresight_rad = 0.01 * kDegree};
};

/// With Hapke's parameters of Li et al. 2004, which are of 550 nm, the render is 1.5 times darker: the frame is of
/// 950 nm, where the single-scattering albedo is 0.43 instead of 0.33. The optics blur by about four pixels. An
/// independent rasteriser reaches an overlap of 0.876.
TEST_F(ErosFrame, FitsARenderAtThePublishedPose) {
    Camera& camera = scene.cameras[0];
    camera.detector.reset();
    camera.white_radiance = full_scale_if * scene.sun->irradiance_w_m2 / std::numbers::pi;
    camera.optics.point_spread = PointSpreadFunction{.sigma_px = 4};
    const auto compared = [&](float albedo) {
        use_hapke(albedo);
        const RenderScene real = *RenderScene::create(scene);
        ModelView view(real, camera, 0, at);
        FrameSettings s;
        s.spp = 16;
        view.render(truth, s, true);
        return *compare_frame({frame.width, frame.height, counts}, sensor_model(camera),
                              {expected_signal(camera, view.radiance()), {}, view.aovs().body}, 0);
    };
    const FrameComparison c = compared(0.43F);
    EXPECT_NEAR(c.gain, 1.06, 0.03);
    EXPECT_NEAR(compared(0.33F).gain, 1.51, 0.05);
    EXPECT_GT(c.overlap(), 0.93);
    ASSERT_TRUE(c.correlation && c.shift);
    EXPECT_GT(*c.correlation, 0.94);
    EXPECT_GT(c.shift->correlation, 0.975);
    EXPECT_LT(std::hypot(c.shift->x_px, c.shift->y_px), 1);
}

TEST_F(ErosFrame, FeaturesAreWithinWhatIsToldOrRefused) {
    FeatureSettings settings;
    settings.model = told;
    FeatureAlignment features(*render_scene, scene.cameras[0], 0, at, settings);
    std::mt19937_64 random(1);
    for (int k = 0; k < 6; ++k) {
        const FeatureEstimate e = features.align(frame, at, off(random));
        expect_honest(e.answer, e.T_camera_target, e.covariance, "features");
    }
}

TEST_F(ErosFrame, DenseIsWithinWhatIsToldOrRefused) {
    DenseAlignment dense(*render_scene, scene.cameras[0], 0);
    DenseOptions o;
    o.model = told;
    std::mt19937_64 random(2);
    const auto e = dense.align(frame, at, off(random), o);
    ASSERT_TRUE(e) << e.error().text();
    expect_honest(e->answer, e->T_camera_body, e->covariance, "dense");
}

/// Craters smaller than the plates, told as details of 20 % of the brightness. The optics' blur is told in part;
/// the rest, to about four pixels, is solved.
TEST_F(ErosFrame, DenseAnswersIfLackingDetailsAreTold) {
    use_hapke(0.43F);
    scene.cameras[0].optics.point_spread = PointSpreadFunction{.sigma_px = 2.5};
    render_scene.emplace(*RenderScene::create(scene));
    frame.dn = counts;
    calibrate();
    DenseAlignment dense(*render_scene, scene.cameras[0], 0);
    DenseOptions o;
    o.model = told;
    o.model.detail = 0.2;
    std::mt19937_64 random(3);
    const auto e = dense.align(frame, at, off(random), o);
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_TRUE(e->answer.usable()) << e->answer.why;
    expect_honest(e->answer, e->T_camera_body, e->covariance, "dense, details");
}

}  // namespace
}  // namespace narpa
