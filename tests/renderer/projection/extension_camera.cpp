// The camera joint: a model that is not in the product renders, projects and culls like the pinhole.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/constants.h"
#include "renderer/frame/culling/tile_culling.h"
#include "renderer/projection/double_sphere.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"
#include "tests/support/equidistant_camera.h"
#include "tests/support/lens_ray.h"

namespace narpa {
namespace {

using namespace test;

const Pinhole kPinholeLens{400, 440, 130, 95};
const EquidistantCamera kEquidistant{150, 140, 130, 95};
const auto kBarrel = brown_conrady(kPinholeLens, {-0.1, 0.02, 1e-3, -2e-3, 0.001});
const auto kFisheyeLens = kannala_brandt({150, 140, 130, 95}, {-0.02, 0.004, -0.001, 1e-4});
const auto kTwoSpheres = make_projection({&kDoubleSphere, {150, 140, 130, 95}, {-0.2, 0.55}});
const std::array<const CameraModel*, 5> kModels{&kPinholeLens, &kEquidistant, kBarrel.get(), kFisheyeLens.get(),
                                                kTwoSpheres.get()};

void expect_consistent(const CameraModel& model, double reach_px, double tolerance) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> around(-reach_px, reach_px), range(0.1, 1e6);
    for (int i = 0; i < 1000; ++i) {
        const ImagePoint p{130 + around(random), 95 + around(random)};
        const Vec3 d = model.direction(p);
        EXPECT_NEAR(norm(d), 1, 1e-15);
        const double r = range(random);
        const auto back = model.project(r * d);
        ASSERT_TRUE(back);
        EXPECT_NEAR(back->x, p.x, 1e-9);
        EXPECT_NEAR(back->y, p.y, 1e-9);
        // Gradients against central differences; along the ray nothing moves.
        const ProjectionJacobian J = model.jacobian(r * d);
        const double h = 1e-5 * r;
        for (int k = 0; k < 3; ++k) {
            Vec3 step{};
            step[k] = h;
            const auto after = model.project(r * d + step), before = model.project(r * d - step);
            EXPECT_NEAR(J.x[k], (after->x - before->x) / (2 * h), tolerance / r);
            EXPECT_NEAR(J.y[k], (after->y - before->y) / (2 * h), tolerance / r);
        }
        EXPECT_NEAR(dot(J.x, d), 0, 1e-9 / r * norm(J.x) * r);
        EXPECT_NEAR(dot(J.y, d), 0, 1e-9 / r * norm(J.y) * r);
        // The area of the image per solid angle, by the directions half a pixel to each side.
        const double solid_angle =
            norm(cross(model.direction({p.x + 0.5, p.y}) - model.direction({p.x - 0.5, p.y}),
                       model.direction({p.x, p.y + 0.5}) - model.direction({p.x, p.y - 0.5})));
        EXPECT_NEAR(model.pixels_per_sr(d) * solid_angle, 1, 1e-3);
    }
}

TEST(CameraModel, ProjectionUndoesDirectionAndMatchesItsDerivatives) {
    for (const CameraModel* model : kModels) expect_consistent(*model, 300, 1e-4);
}

TEST(CameraModel, BatchHasTheSameDirections) {
    for (const CameraModel* model : kModels) {
        const Quat q = normalized(Quat{0.3, -0.5, 0.7, 0.2});
        Lanes<double> x, y;
        for (std::size_t i = 0; i < kLanes; ++i)
            x[i] = 17.25 * static_cast<double>(i), y[i] = 190 - 11.5 * static_cast<double>(i);
        Vec3Lanes directions;
        model->directions(q, x, y, directions);
        for (std::size_t i = 0; i < kLanes; ++i) EXPECT_EQ(directions[i], q * model->direction({x[i], y[i]}));
    }
}

TEST(CameraModel, ConeOfARectangleHoldsItsRays) {
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> place(-200, 400), size(0.1, 150), part(0, 1);
    for (const CameraModel* model : kModels)
        for (int i = 0; i < 200; ++i) {
            ImageRect r{place(random), place(random), 0, 0};
            r.x_high = r.x_low + size(random), r.y_high = r.y_low + size(random);
            const DirectionCone cone = model->bounds(r);
            for (int k = 0; k < 50; ++k) {
                const Vec3 d = model->direction(
                    {std::lerp(r.x_low, r.x_high, part(random)), std::lerp(r.y_low, r.y_high, part(random))});
                EXPECT_LE(std::atan2(norm(cross(d, cone.axis)), dot(d, cone.axis)), cone.half_angle_rad + 1e-12);
            }
        }
}

TEST(CameraModel, ScaledAndWindowedCamerasSeeTheSameRays) {
    Camera pinhole;
    pinhole.width = 260, pinhole.height = 190;
    set_pinhole(pinhole, 400, 440, 130, 95);
    for (const Camera& c : {pinhole, with_equidistant(pinhole, 150)}) {
        const Camera coarse = scaled(c, 1 / 3.0, 0.5), part = windowed(c, 31, 17, 64, 48);
        EXPECT_EQ(coarse.width, 86);
        EXPECT_EQ(coarse.height, 95);
        const auto &whole = c.model, &of_coarse = coarse.model, &of_part = part.model;
        // Pixel (10, 20) covers columns 30, 31, 32 and rows 40, 41 of the finer image.
        EXPECT_LT(norm(of_coarse->direction({10, 20}) - whole->direction({31, 40.5})), 1e-15);
        EXPECT_LT(norm(of_part->direction({3, 4}) - whole->direction({34, 21})), 1e-15);
    }
}

TEST(CameraModel, APinholeHasNoImageOfWhatIsBehindIt) {
    EXPECT_FALSE(kPinholeLens.project({0, 0, -1}));
    EXPECT_FALSE(kPinholeLens.project({1, 0, 0}));
    EXPECT_TRUE(kEquidistant.project({1, 0, -0.5}));
}

/// Emits 1 W m^-2 sr^-1 in each band.
Scene glowing_sphere(double radius_m, const Vec3& centre) {
    Scene s;
    Material m = lambert(0);
    m.emission = {1, 1, 1};
    s.materials.push_back(m);
    add_sphere(s, radius_m, centre);
    return s;
}

/// Of the lit part: area in pixels, first moment, and the solid angle by the model.
struct Blob {
    double area_px2 = 0, x = 0, y = 0, solid_angle_sr = 0;
};
Blob blob(const RadianceImage& image, const CameraModel& model) {
    Blob b;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double v = static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y);
            if (v <= 0) continue;
            b.area_px2 += v, b.x += v * x, b.y += v * y;
            b.solid_angle_sr +=
                v / model.pixels_per_sr(model.direction({static_cast<double>(x), static_cast<double>(y)}));
        }
    b.x /= b.area_px2, b.y /= b.area_px2;
    return b;
}

TEST(EquidistantCamera, ImageOfASphereOnTheAxisHasRadiusFTheta) {
    const Camera c = with_equidistant(camera(200, 200, 1), 80);
    const double half = std::asin(2.0 / 3);  // 42 degrees
    const Blob b = blob(rendered(glowing_sphere(2, {0, 0, 3}), c, {}, {.spp = 64}), *c.model);
    EXPECT_NEAR(b.area_px2, kPi * (80 * half) * (80 * half), 10);
    EXPECT_NEAR(b.solid_angle_sr, 2 * kPi * (1 - std::cos(half)), 1e-3 * b.solid_angle_sr);
    EXPECT_NEAR(b.x, 99.5, 0.02);
    EXPECT_NEAR(b.y, 99.5, 0.02);
}

TEST(EquidistantCamera, SeesASphereBehindItsImagePlane) {
    // 110 degrees off the axis, where no pinhole looks.
    const Camera c = with_equidistant(camera(400, 200, 1), 80);
    const double half = std::asin(0.3), off = 110 * kPi / 180;
    const Scene scene = glowing_sphere(0.3, {std::sin(off), 0, std::cos(off)});
    Aovs aovs;
    const Blob b = blob(rendered(scene, c, {}, {.spp = 64}, &aovs), *c.model);
    EXPECT_NEAR(b.solid_angle_sr, 2 * kPi * (1 - std::cos(half)), 2e-3 * b.solid_angle_sr);
    // Along the row through its centre it reaches from f (off - half) to f (off + half).
    const auto* row = &aovs.body[static_cast<std::size_t>(99 * c.width)];
    const auto first = std::find(row, row + c.width, 0) - row;
    const auto end = std::find(row + first, row + c.width, -1) - row;
    EXPECT_NEAR(static_cast<double>(first) - 0.5, 199.5 + 80 * (off - half), 0.6);
    EXPECT_NEAR(static_cast<double>(end) - 0.5, 199.5 + 80 * (off + half), 0.6);
}

TEST(EquidistantCamera, ASubpixelBodyKeepsItsLight) {
    const Camera c = with_equidistant(camera(200, 200, 1), 80);
    const double radius = 2e-3;  // 0.3 px wide
    const Vec3 direction = c.model->direction({171.3, 28.8});
    const Blob b = blob(rendered(glowing_sphere(radius, direction), c, {}, {.spp = 4}), *c.model);
    EXPECT_NEAR(b.solid_angle_sr, 2 * kPi * (1 - std::cos(std::asin(radius))), 0.01 * b.solid_angle_sr);
    EXPECT_NEAR(b.x, 171.3, 0.5);
    EXPECT_NEAR(b.y, 28.8, 0.5);
}

TEST(EquidistantCamera, BudgetedFramesMatchUniformOnes) {
    const Camera c = with_equidistant(camera(160, 120, 1), 70);
    Scene scene;
    scene.materials.push_back(lambert(0.6f));
    add_mesh(scene, bumpy(3, 1, 0.2), {{}, {0.5, 0.2, 2}});
    add_sun(scene, {0.3, -0.5, -1});
    auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    FrameSettings settings;
    RadianceImage budgeted(c.width, c.height), uniform(c.width, c.height);
    settings.spp = 64;
    render_radiance(*render_scene, placed(scene), c, {}, settings, uniform);
    settings.budget = {.kind = FrameBudget::Kind::rays, .rays = 400'000};
    render_radiance(*render_scene, placed(scene), c, {}, settings, budgeted);
    EXPECT_NEAR(blob(budgeted, *c.model).area_px2, blob(uniform, *c.model).area_px2,
                5e-3 * blob(uniform, *c.model).area_px2);
}

TEST(EquidistantCamera, PixelsBeyondTheImageCircleAreBlack) {
    const Camera c = with_equidistant(camera(100, 100, 1), 80, 0.5);
    Scene inside = glowing_sphere(10, {});
    const RadianceImage image = rendered(inside, c, {}, {.spp = 4});
    EXPECT_EQ(image.pixels[50 * 100 + 50].y, 1);
    EXPECT_EQ(image.pixels[50 * 100 + 95].y, 0);
    EXPECT_NEAR(blob(image, *c.model).area_px2, kPi * 40 * 40, 40);
}

TEST(EquidistantCamera, ItsLensBlursToTheCircleOfConfusion) {
    // A far point on the axis, focused near: a disc of aperture / focus radians.
    Camera c = with_equidistant(camera(120, 120, 1), 400);
    c.optics.lens = Lens{0.1, 1.0};
    const Blob b = blob(rendered(glowing_sphere(1000, {0, 0, 1e5}), c, {}, {.spp = 256}), *c.model);
    const double radiance = b.area_px2;  // of all pixels together: the sphere's own image
    EXPECT_NEAR(radiance, kPi * std::pow(400 * 0.01, 2), 0.02 * radiance);
}

TEST(EquidistantCamera, TileCullingMissesNoBody) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> unit(0, 1);
    Scene scene;
    scene.materials.push_back(lambert(1));
    for (int i = 0; i < 4; ++i) add_mesh(scene, bumpy(2, 1 + i, 0.4));
    for (int i = 0; i < 4; ++i) add_mesh(scene, box(10, 0.1 + i, 0.3));
    for (int i = 0; i < 4; ++i) add_sphere(scene, std::pow(10.0, i - 2), {});
    scene.bodies.back().shape = exact_ellipsoid({0.1, 3, 20});
    auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    const Camera c = with_equidistant(camera(150, 115, 1), 45);
    TileCulling culling(*tracer, c);
    BodyPoses at(scene.bodies.size());
    std::size_t met = 0, missed = 0, listed = 0;
    for (int pose = 0; pose < 40; ++pose) {
        const Rigid3 T{random_attitude(random), 1e4 * random_direction(random)};
        for (std::size_t b = 0; b < scene.bodies.size(); ++b)
            at.set(b, {random_attitude(random), T.t + tracer->bounding_radius_m(b) * std::exp(4 * unit(random)) *
                                                          unit(random) * random_direction(random)});
        const Lens lens{0.3 * unit(random), 1 + 10 * unit(random)};
        const bool pinpoint = pose % 2 == 0;
        culling.update(at, T, pinpoint ? nullptr : &lens);
        for (int i = 0; i < 1500; ++i) {
            const double x = -0.5 + c.width * unit(random), y = -0.5 + c.height * unit(random);
            Ray ray = camera_ray(c, T, x, y);
            if (!pinpoint) {
                if (c.model->direction({x, y}).z < 0.05) continue;
                ray = lens_ray(c, lens, T, x, y, aperture_point(lens, unit(random), 0.999999));
            }
            const auto bodies =
                culling.bodies(static_cast<int>((x + 0.5) / kTileSize), static_cast<int>((y + 0.5) / kTileSize));
            listed += bodies.size();
            for (int skip = -1, behind = 0; behind < 2; ++behind) {
                const Hit hit = tracer->intersect(at, ray, kInfinity, skip);
                if (hit.body < 0) break;
                ++met;
                missed += !std::binary_search(bodies.begin(), bodies.end(), static_cast<std::uint32_t>(hit.body));
                skip = hit.body;
            }
        }
    }
    EXPECT_EQ(missed, 0u) << "of " << met;
    EXPECT_GT(met, 20'000u);
    EXPECT_LT(listed, 6 * met);  // and does not simply list everything
}

}  // namespace
}  // namespace narpa
