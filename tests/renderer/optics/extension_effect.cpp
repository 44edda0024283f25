// The joint of optical effects: an effect that the product does not have, an image of the image by two reflections
// in the lens, is this file alone: a scene names it, and frames show it.
#include <gtest/gtest.h>

#include "renderer/keys/toml_reader.h"
#include "renderer/optics/optical_effect.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using namespace test;

/// A share of each pixel's light reaches the opposite pixel, too.
class OppositeImage final : public ImageEffect {
public:
    OppositeImage(double share, const ImagePlane& plane)
        : share_(static_cast<float>(share)), before_(plane.width, plane.height) {}
    void apply(const ImageExposure&, RadianceImage& image) noexcept override {
        before_.pixels = image.pixels;
        for (std::size_t i = 0; i < image.pixels.size(); ++i)
            image.pixels[i] = image.pixels[i] + share_ * before_.pixels[image.pixels.size() - 1 - i];
    }

private:
    float share_;
    RadianceImage before_;
};

class Reflection final : public OpticalEffect {
public:
    explicit Reflection(double share) : share_(share) {}
    [[nodiscard]] std::unique_ptr<ImageEffect> make(const ImagePlane& plane) const override {
        return std::make_unique<OppositeImage>(share_, plane);
    }
    [[nodiscard]] bool spreads_light() const noexcept override { return true; }

private:
    double share_;
};

constexpr TableKey kReflectionOfCamera[]{{"reflection", rows::number(kUnit)}};
const OpticsKind kReflection{kReflectionOfCamera, [](TableReader& camera, const OpticsContext&, Optics& optics) {
                                 if (const auto share = camera.number("reflection"))
                                     optics.effects.push_back(std::make_shared<Reflection>(*share));
                             }};

/// The shipped kinds and this one.
std::span<const OpticsKind* const> effect_kinds() {
    static const std::vector<const OpticsKind*> all = [] {
        std::vector<const OpticsKind*> kinds(optics_kinds().begin(), optics_kinds().end());
        kinds.push_back(&kReflection);
        return kinds;
    }();
    return all;
}
constexpr TableKeys kTableWithEffect{.listed = keys_of<effect_kinds>};

Camera camera_with_effects(const std::string& effects) {
    Camera c = camera(64, 48, 60);
    c.optics = read_table(effects, kTableWithEffect, [&](TableReader& table) {
        return read_optics(table, {.plane = c.plane()}, effect_kinds());
    });
    return c;
}

/// A lit ball at the upper left.
Scene ball_off_the_axis() {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    add_sphere(scene, 1, {-1.5, -1, 6});
    add_sun(scene, {0.2, 0.3, -1});
    return scene;
}

void expect_reflection(const std::string& shipped, float share) {
    const Scene scene = ball_off_the_axis();
    const RadianceImage plain = rendered(scene, camera_with_effects(shipped)),
                        with = rendered(scene, camera_with_effects(shipped + "reflection = 0.25\n"));
    const std::size_t n = plain.pixels.size();
    int lit = 0;
    for (std::size_t i = 0; i < n; ++i) {
        EXPECT_EQ(with.pixels[i], plain.pixels[i] + share * plain.pixels[n - 1 - i]) << i;
        lit += plain.pixels[i].y > 2 * plain.pixels[n - 1 - i].y;
    }
    EXPECT_GT(lit, 100) << "pixels of the ball, which the reflection shows elsewhere";
}

TEST(OpticsJoint, AnAddedEffectActsOnTheImage) {
    expect_reflection("", 0.25f);
}

TEST(OpticsJoint, AnAddedEffectActsAfterTheShippedOnes) {
    expect_reflection("vignetting = {cos4 = true}\npsf = {sigma_px = 1}\nveiling_glare = 0.1\n", 0.25f);
    const Camera c = camera_with_effects("vignetting = {cos4 = true}\nreflection = 0.25\n");
    EXPECT_EQ(c.optics.effects.size(), 2u);
    EXPECT_TRUE(c.optics.spreads_light());
    EXPECT_FALSE(camera_with_effects("vignetting = {cos4 = true}\n").optics.spreads_light());
}

}  // namespace
}  // namespace narpa
