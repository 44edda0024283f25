// The thin lens: Gauss's equation, the circle of confusion, and the blur of whole pictures against it.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"
#include "tests/support/lens_ray.h"
#include "tests/support/oracle.h"

namespace narpa {
namespace {

using namespace test;

TEST(ThinLens, OracleOfTheCircleOfConfusion) {
    NEED_ORACLE(reference, "thin_lens");
    int judged = 0;
    for (const auto& c : reference["cases"]) {
        const auto &in = c["in"], &out = c["out"];
        const double focus = in["inv_focus_distance_per_m"], depth = in["inv_object_distance_per_m"];
        const double aperture = in["aperture_diameter_m"], expected = out["coc_diameter_px"];
        const bool almost_in_focus = c["description"].get<std::string>().starts_with("almost in focus");
        EXPECT_NEAR(circle_of_confusion_px({aperture, 1 / focus}, out["focal_px_effective"], 1 / depth), expected,
                    (almost_in_focus ? 1e-8 : 1e-12) * expected)
            << c["id"];
        ++judged;
    }
    EXPECT_EQ(judged, 27);
}

TEST(ThinLens, StarsAreBlurredByTheApertureOverTheFocusDistance) {
    // f/2.8, 50 mm, focused at 2 m.
    const Lens lens{0.05 / 2.8, 2};
    EXPECT_DOUBLE_EQ(circle_of_confusion_px(lens, 1000, kInfinity), 1000 * lens.aperture_diameter_m / 2);
    EXPECT_EQ(circle_of_confusion_px(lens, 1000, 2), 0);
    EXPECT_EQ(circle_of_confusion_px({0.02, kInfinity}, 1000, kInfinity), 0);
}

Camera with_lens(Camera c, double aperture_m, double focus_m) {
    c.optics.lens = Lens{aperture_m, focus_m};
    return c;
}

TEST(Lens, RaysOfAPixelMeetAtThePlaneOfFocus) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> unit(0, 1);
    const Rigid3 T = looking({1, 2, 3}, {-4, 1, 0});
    for (const double focus : {0.3, 5.0, 1e4, kInfinity})
        for (int i = 0; i < 100; ++i) {
            const Camera c = with_lens(camera(640, 480, 700), 0.05, focus);
            const double x = 640 * unit(random), y = 480 * unit(random);
            const Vec3 from = aperture_point(*c.optics.lens, unit(random), unit(random));
            EXPECT_LE(norm(from), 0.025);
            const Ray pinhole = camera_ray(c, T, x, y), ray = lens_ray(c, *c.optics.lens, T, x, y, from);
            EXPECT_NEAR(norm(ray.direction), 1, 1e-14);
            const Vec3 axis = T.q * Vec3{0, 0, 1};
            if (std::isinf(focus)) {
                EXPECT_LE(norm(ray.direction - pinhole.direction), 1e-15);
            } else {
                const Vec3 p = pinhole.origin + focus / dot(pinhole.direction, axis) * pinhole.direction;
                const Vec3 q = ray.origin + focus / dot(ray.direction, axis) * ray.direction;
                EXPECT_LE(norm(p - q), 1e-13 * (focus + 10));
            }
            const Vec3 chief = chief_direction(*c.optics.lens, conjugate(T.q) * ray.direction, from);
            const auto [back_x, back_y] = *pinhole_of(c).project(chief);
            EXPECT_NEAR(back_x, x, 1e-9);
            EXPECT_NEAR(back_y, y, 1e-9);
        }
}

Scene emitting_ball() {
    Scene s;
    s.materials.push_back(lambert(0));
    s.materials[0].emission = {1, 1, 1};
    return s;
}

/// What part of a blur disc of this diameter, centred d beyond a straight edge, lies beyond it.
double beyond_edge(double d, double diameter) {
    const double t = std::clamp(2 * d / diameter, -1.0, 1.0);
    return 1 - (std::acos(t) - t * std::sqrt(1 - t * t)) / kPi;
}

TEST(Lens, AnEdgeOutOfFocusIsSpreadOverTheCircleOfConfusion) {
    for (const double depth : {2.0, 40.0})  // nearer and farther than the focus
        for (const double focus : {8.0, kInfinity}) {
            if (depth > 10 && std::isinf(focus)) continue;
            const Camera c = with_lens(camera(61, 1, 400), 0.1, focus);
            Scene s = emitting_ball();
            const double wide = 100 * depth;
            add_mesh(s, plate(wide, wide), {{0, 1, 0, 0}, {wide / 2, 0, depth}});  // its edge on the axis
            const RadianceImage image = rendered(s, c, {}, {.spp = 1024});
            const double blur = circle_of_confusion_px(*c.optics.lens, pinhole_of(c).fx, depth);
            EXPECT_GT(blur, 3);
            for (int x = 0; x < c.width; ++x) {
                double expected = 0;  // the pixel is a window one wide
                for (int k = 0; k < 16; ++k)
                    expected += beyond_edge(x - pinhole_of(c).cx + (k + 0.5) / 16 - 0.5, blur) / 16;
                // 1024 stratified samples of a step: the error of each is below 1 / 64.
                EXPECT_NEAR(static_cast<double>(image.pixels[static_cast<std::size_t>(x)].x), expected, 0.012)
                    << "depth " << depth << " focus " << focus << " x " << x;
            }
        }
}

TEST(Lens, AFarPointIsADiscOfTheCircleOfConfusionAndKeepsItsLight) {
    // A shining ball 0.2 px wide, behind the plane of focus: its blur is 14 px wide.
    const double depth = 500, radius = 0.1 * depth / 700;
    const Camera c = with_lens(camera(41, 41, 700), 0.1, 4.9);
    const double blur = circle_of_confusion_px(*c.optics.lens, pinhole_of(c).fx, depth);
    Scene s = emitting_ball();
    add_sphere(s, radius, {0.3 * depth / 700, -0.2 * depth / 700, depth});
    const RadianceImage image = rendered(s, c, {}, {.spp = 4});
    double sum = 0, x1 = 0, y1 = 0, r2 = 0, outside = 0;
    for (int y = 0; y < c.height; ++y)
        for (int x = 0; x < c.width; ++x) {
            const double l = static_cast<double>(image.pixels[static_cast<std::size_t>(y * c.width + x)].x);
            const double dx = x - pinhole_of(c).cx - 0.3, dy = y - pinhole_of(c).cy + 0.2;
            sum += l, x1 += l * dx, y1 += l * dy, r2 += l * (dx * dx + dy * dy);
            if (std::hypot(dx, dy) > 0.5 * blur + 0.2 + std::sqrt(0.5)) outside += l;
        }
    EXPECT_NEAR(sum / (kPi * 0.01), 1, 5e-3);  // its disc, pi 0.1^2 px^2, of radiance 1
    EXPECT_NEAR(x1 / sum, 0, 0.1);
    EXPECT_NEAR(y1 / sum, 0, 0.1);
    EXPECT_EQ(outside, 0);
    // A disc's mean squared radius is half of its radius squared; a pixel adds 1/6.
    EXPECT_NEAR(r2 / sum, blur * blur / 8 + 1.0 / 6, 0.02 * blur * blur / 8);
}

TEST(Lens, OneSampleAPixelAndWhatIsInFocusAreAsThroughAPinhole) {
    Scene s = emitting_ball();
    add_mesh(s, plate(3, 3), {normalized(Quat{1, 0.1, 0.2, 0.1}), {0.3, 0.1, 8}});
    const Camera pinhole = camera(48, 36, 60), wide_open = with_lens(pinhole, 0.3, 2);
    EXPECT_EQ(rendered(s, pinhole, {}, {.spp = 1}).pixels, rendered(s, wide_open, {}, {.spp = 1}).pixels);
    EXPECT_NE(rendered(s, pinhole, {}, {.spp = 16}).pixels, rendered(s, wide_open, {}, {.spp = 16}).pixels);
    EXPECT_EQ(rendered(s, pinhole, {}, {.spp = 16}).pixels,
              rendered(s, with_lens(pinhole, 0, 2), {}, {.spp = 16}).pixels);

    Scene facing = emitting_ball();
    add_mesh(facing, plate(3, 3), {{0, 1, 0, 0}, {0.3, 0.1, 8}});
    const auto sharp = rendered(facing, pinhole, {}, {.spp = 64}),
               focused = rendered(facing, with_lens(pinhole, 0.3, 8), {}, {.spp = 64});
    for (std::size_t i = 0; i < sharp.pixels.size(); ++i)
        EXPECT_NEAR(sharp.pixels[i].x, focused.pixels[i].x, 1e-6) << i;
}

}  // namespace
}  // namespace narpa
