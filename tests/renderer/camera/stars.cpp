// Stars in the image: where they stand, how much light they give, what hides them.
#include <tbb/global_control.h>

#include "renderer/detector/detector.h"
#include "renderer/optics/veiling_glare.h"
#include "renderer/optics/vignetting.h"
#include "tests/renderer/camera/star_support.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kArcsec = kPi / 180 / 3600;

const PointSpreadFunction kGaussian{.sigma_px = 0.7}, kAiry{.cutoff_per_px = 0.8},
    kBoth{.sigma_px = 0.5, .cutoff_per_px = 1.1};

TEST(Stars, CentroidsAreWithinAHundredthOfAPixel) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> offset(-0.5, 0.5);
    for (const PointSpreadFunction& spread : {kGaussian, kAiry, kBoth}) {
        Camera c = camera(101, 101, 2000);
        c.optics.point_spread = spread;
        const Scene scene = sky({{0, 0, 1}});
        auto render_scene = RenderScene::create(scene, 1);
        ASSERT_TRUE(render_scene);
        CameraRenderer renderer(*render_scene, c);
        for (int i = 0; i < 40; ++i) {
            const ImagePoint p{50 + offset(random), 50 + offset(random)};
            const Vec3 d = c.model->direction(p);
            // Turns the camera so that the star is at p.
            const Rigid3 T_world_camera{
                exp_rotation({std::asin(d.y), 0, 0}) * exp_rotation({0, -std::atan2(d.x, d.z), 0}), {}};
            const auto wanted = c.model->project(conjugate(T_world_camera.q) * Vec3{0, 0, 1});
            RadianceImage image(c.width, c.height);
            renderer.render(placed(scene), T_world_camera, {}, image);
            const Spot spot = spot_in(image);
            EXPECT_NEAR(spot.x, wanted->x, 0.01);
            EXPECT_NEAR(spot.y, wanted->y, 0.01);
        }
    }
}

/// Electrons in the image, by the detector's own constants.
double electrons_in(const RadianceImage& image, const Detector& d) {
    double sum = 0;
    for (const Rgb& v : image.pixels)
        for (int band = 0; band < 3; ++band) sum += static_cast<double>(v[band]) * electrons_per_radiance(d, band);
    return sum;
}

TEST(Stars, ElectronsAreThoseThatTheApertureCollects) {
    // The Sun's photons at V = -26.76, through an aperture of focal length / f-number, at any place in the image.
    Camera c = camera(201, 151, 1000);
    c.detector = Detector{.exposure_s = 0.1, .pixel_pitch_m = 5e-6, .f_number = 1.4, .quantum_efficiency = 0.6};
    const double aperture_m = 1000 * 5e-6 / 1.4, area_m2 = kPi / 4 * aperture_m * aperture_m;
    double wanted = 0;
    for (int band = 0; band < 3; ++band) {
        const double star = static_cast<double>(star_irradiance(3, 0.65)[band]);
        EXPECT_NEAR(star / (1361 * std::pow(10, -0.4 * (3 + 26.76))), 1, 0.01);  // the colour of the Sun
        wanted += star * area_m2 * electrons_per_radiance(*c.detector, band) * 4 * 1.4 * 1.4 / (kPi * 25e-12);
    }
    for (const auto& spread :
         {std::optional<PointSpreadFunction>{}, std::optional(kGaussian), std::optional(kAiry)}) {
        c.optics.point_spread = spread;
        EXPECT_NEAR(electrons_in(rendered(sky({{0.0003, -0.0002, 1}}, 3), c), *c.detector) / wanted, 1, 0.005);
    }
    // Off the axis the aperture is seen from the side: with cos^4 the light falls with the cosine, as it should.
    set_pinhole(c, 100, 100, pinhole_of(c).cx, pinhole_of(c).cy);
    c.optics.effects = {vignetting({.cos4 = true})};
    c.optics.point_spread = kGaussian;
    EXPECT_NEAR(electrons_in(rendered(sky({{0.6, 0.4, 1}}, 3), c), *c.detector) /
                    (wanted / 100 / std::sqrt(1 + 0.36 + 0.16)),
                1, 0.005);
}

TEST(Stars, MagnitudesAndColours) {
    const Rgb white = star_irradiance(0, 0.65);
    EXPECT_NEAR(star_irradiance(5, 0.65).y / white.y, 0.01f, 1e-6);
    EXPECT_NEAR(star_irradiance(0, 1.5).y / white.y, 1, 1e-6);
    EXPECT_GT(star_irradiance(0, 1.5).x, 1.3f * white.x);
    EXPECT_LT(star_irradiance(0, 1.5).z, 0.7f * white.z);
    EXPECT_GT(star_irradiance(0, -0.2).z, 1.2f * white.z);
}

TEST(Stars, KeepTheirLightInEveryCamera) {
    const Vec3 direction = normalized(Vec3{0.5, -0.3, 1});
    Camera c = camera(240, 200, 120);
    c.optics.point_spread = kGaussian;
    const Pinhole pinhole = pinhole_of(c);
    for (const auto& projection : {c.model, brown_conrady(pinhole, {-0.2, 0.05, 1e-3, -1e-3}),
                                   kannala_brandt(pinhole, {0.02, -0.01, 0, 0})}) {
        c.model = projection;
        const CameraModel& model = *c.model;
        const Spot spot = spot_in(rendered(sky({direction}), c));
        const auto wanted = model.project(direction);
        EXPECT_NEAR(spot.x, wanted->x, 0.01);
        EXPECT_NEAR(spot.y, wanted->y, 0.01);
        EXPECT_NEAR(spot.sum / model.pixels_per_sr(direction) / static_cast<double>(star_irradiance(0, 0.65).y), 1,
                    1e-4);
    }
}

TEST(Stars, StayInOnePixelWithoutAPointSpread) {
    const Camera c = camera(21, 21, 1000);
    const RadianceImage image = rendered(sky({{0.0002, 0.0003, 1}}), c);
    EXPECT_NEAR(static_cast<double>(image.pixels[10 * 21 + 10].y) / spot_in(image).sum, 1, 0.005);
}

TEST(Stars, AreDiscsWhereTheLensIsFocusedNearby) {
    Camera c = camera(61, 61, 1000);
    c.optics.lens = Lens{.aperture_diameter_m = 0.04, .focus_distance_m = 2};  // discs of 20 px
    const Vec3 direction = {0.0002, 0.0003, 1};
    const RadianceImage image = rendered(sky({direction}), c);
    const Spot spot = spot_in(image);
    EXPECT_NEAR(spot.x, 30.2, 0.01);
    EXPECT_NEAR(spot.y, 30.3, 0.01);
    for (int y = 0; y < 61; ++y)
        for (int x = 0; x < 61; ++x) {
            const double v = static_cast<double>(image.pixels[static_cast<std::size_t>(y * 61 + x)].y) / spot.sum;
            const double r = std::hypot(x - 30.2, y - 30.3);
            if (std::abs(r - 10) < 1) continue;
            EXPECT_NEAR(v * kPi * 100, r < 10 ? 1 : 0, 0.02) << x << ", " << y;
        }
    c.optics.lens->focus_distance_m = kInfinity;
    EXPECT_LT(static_cast<double>(rendered(sky({direction}), c).pixels[29 * 61 + 30].y), 0.005 * spot.sum);
}

TEST(Stars, FollowAPointSpreadThatIsAnImage) {
    auto image = std::make_shared<PointSpreadImage>();
    *image = {.width = 6, .height = 4, .centre_x = 1, .centre_y = 2, .samples = std::vector<double>(24)};
    image->samples[2 * 6 + 1] = 0.75, image->samples[0 * 6 + 5] = 0.25;  // in the centre; 2 px right and 1 px above
    Camera c = camera(61, 61, 1000);
    c.optics.point_spread = PointSpreadFunction{.sigma_px = 0.6, .image = image, .samples_per_px = 2};
    for (const double x : {0.0, 0.0003, -0.0004}) {
        const Spot spot = spot_in(rendered(sky({{x, 0.0002, 1}}), c));
        EXPECT_NEAR(spot.x, 30 + 1000 * x + 0.25 * 2, 0.01);
        EXPECT_NEAR(spot.y, 30.2 - 0.25 * 1, 0.01);
    }
}

TEST(Stars, BesideTheImageGiveItTheEdgeOfTheirSpot) {
    Camera c = camera(21, 21, 1000);
    c.optics.point_spread = PointSpreadFunction{.sigma_px = 1};
    const Spot whole = spot_in(rendered(sky({{0, 0, 1}}), c));
    const Spot half = spot_in(rendered(sky({{-0.0105, 0, 1}}), c));  // on the outer border of the first column
    EXPECT_NEAR(half.sum / whole.sum, 0.5, 0.005);
    EXPECT_EQ(spot_in(rendered(sky({{-0.03, 0, 1}, {0, 0, -1}}), c)).sum, 0);
}

TEST(Stars, VeilingGlareSpreadsTheirLightToo) {
    Camera c = camera(21, 21, 1000);
    const double sum = spot_in(rendered(sky({{0, 0, 1}}), c)).sum;
    c.optics.effects = {veiling_glare(0.1)};
    const RadianceImage image = rendered(sky({{0, 0, 1}}), c);
    EXPECT_NEAR(static_cast<double>(image.pixels[0].y), 0.1 * sum / (21 * 21), 1e-6 * sum);
}

TEST(Stars, BodiesHideThem) {
    Scene scene = sky({{-0.02, 0, 1}, {0.02, 0, 1}});
    scene.materials.push_back(lambert(0.5f));
    add_sphere(scene, 1, {2, 0, 100});  // of 10 px, black without a Sun, before the second
    Camera c = camera(101, 101, 1000);
    c.optics.point_spread = kGaussian;
    const Spot spot = spot_in(rendered(scene, c));
    EXPECT_NEAR(spot.x, 30, 0.01);
    scene.bodies.clear();
    EXPECT_NEAR(spot_in(rendered(scene, c)).sum / spot.sum, 2, 1e-3);
}

TEST(Stars, AirDimsThem) {
    // From the ground at night, at two heights above the horizon.
    for (const double zenith_deg : {30.0, 80.0}) {
        const double z = zenith_deg * kPi / 180;
        Scene scene = sky({{0, 0, 1}});
        scene.materials.push_back(lambert(0.3f));
        add_sphere(scene, 6'371'000, -6'371'002 * Vec3{std::sin(z), 0, std::cos(z)});
        Camera c = camera(21, 21, 1000);
        c.optics.point_spread = kGaussian;
        const RadianceImage vacuum = rendered(scene, c);
        scene.atmosphere = coarse_earth_air();
        const auto render_scene = RenderScene::create(scene, 2);
        ASSERT_TRUE(render_scene);
        const RadianceImage through = rendered(*render_scene, placed(scene), c);
        const Rgb expected = render_scene->medium()->transmittance(placed(scene), {{}, {0, 0, 1}}, kInfinity);
        EXPECT_LT(expected.z, zenith_deg < 45 ? 0.8f : 0.4f);
        const std::size_t middle = 10 * 21 + 10;
        for (int band = 0; band < 3; ++band)
            EXPECT_NEAR(through.pixels[middle][band] / vacuum.pixels[middle][band], expected[band],
                        1e-5f * expected[band])
                << zenith_deg;
    }
}

TEST(Stars, AreDisplacedByTheVelocityOfTheObserver) {
    // The Earth's 29.79 km/s across the line of sight: 20.5 arcsec, tan-formula of special relativity.
    const double beta = 29790.0 / 299792458;
    const Vec3 seen = aberrated({0, 0, 1}, {29790, 0, 0});
    EXPECT_NEAR(std::atan2(seen.x, seen.z), std::asin(beta), 1e-15);
    EXPECT_NEAR(std::atan2(seen.x, seen.z) / kArcsec, 20.497, 0.001);
    for (const double v : {1e3, 3e7, 2.5e8})
        for (const double theta : {0.1, 1.0, 2.0, 3.1}) {
            const Vec3 s = aberrated({std::sin(theta), 0, std::cos(theta)}, {0, 0, v});
            const double b = v / 299792458;
            EXPECT_NEAR(std::atan2(s.x, s.z), 2 * std::atan(std::sqrt((1 - b) / (1 + b)) * std::tan(theta / 2)),
                        1e-12);
        }
    // In the image: 100,000 px per radian, by the world's velocity and the camera's own.
    Camera c = camera(101, 101, 1e5);
    c.optics.point_spread = kGaussian;
    Scene scene = sky({{0, 0, 1}});
    scene.stars->velocity_m_s = {29790, 0, 0};
    CameraPose pose;
    pose.set_clock(0, 0, {0, -7500, 0});
    const Spot spot = spot_in(rendered(scene, c, pose));
    EXPECT_NEAR(spot.x, 50 + 1e5 * beta, 0.01);
    EXPECT_NEAR(spot.y, 50 - 1e5 * 7500 / 299792458, 0.01);
}

TEST(Stars, TurnWithTheWorldFrame) {
    Camera c = camera(101, 101, 1000);
    c.optics.point_spread = kGaussian;
    Scene scene = sky({{1, 0, 0}});
    scene.stars->q_icrs_world = exp_rotation({0, kPi / 2, 0});  // the world's z is ICRS's x
    EXPECT_NEAR(spot_in(rendered(scene, c)).x, 50, 0.01);
    scene.stars->rate_rad_s = {0, 1e-3, 0};  // the world's z turns towards its x, so stars go to -x
    CameraPose pose;
    pose.set_clock(19.9, 20.1, {});
    EXPECT_NEAR(spot_in(rendered(scene, c, pose)).x, 50 - 1000 * std::tan(0.02), 0.01);
}

TEST(Stars, AreTheSameOnAnyNumberOfThreadsAndAllocateNothing) {
    std::mt19937_64 random(3);
    std::vector<Vec3> many;
    for (int i = 0; i < 20000; ++i) many.push_back(random_direction(random));
    Scene scene = sky(many, 4);
    scene.materials.push_back(lambert(0.5f));
    add_sphere(scene, 10, {5, 0, 100});
    add_sun(scene, {-1, 0, -1});
    Camera c = camera(160, 120, 100);
    c.optics.point_spread = kBoth;
    const CameraPose pose = turning({0.02, 0.05, 0.1}, 0.5 / 119);
    const RadianceImage all = rendered(scene, c, pose);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(rendered(scene, c, pose).pixels, all.pixels);
    if (!kAllocationsAreCounted) GTEST_SKIP() << "the sanitizer has its own heap";
    auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    CameraRenderer renderer(*render_scene, c);
    const BodyPoses at = placed(scene);
    RadianceImage image(c.width, c.height);
    renderer.render(at, pose, {}, image);
    const AllocationCounter count;
    renderer.render(at, pose, {}, image);
    EXPECT_EQ(count.on_all_threads(), 0u);
}

}  // namespace
}  // namespace narpa
