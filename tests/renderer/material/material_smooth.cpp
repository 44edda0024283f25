// Mirrors and clear dielectrics against 60-digit reference numbers and the laws they keep.
#include <gtest/gtest.h>

#include "renderer/material/fresnel.h"
#include "tests/renderer/material/material_support.h"
#include "tests/support/oracle.h"

namespace narpa {
namespace {

using namespace test;
using nlohmann::json;

Vec3 material_vec(const json& a) {
    return {a[0], a[1], a[2]};
}

void expect_near(const Vec3& a, const Vec3& b, double tolerance, const std::string& label) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << label;
}

TEST(SmoothInterface, MeetsTheReferenceNumbers) {
    NEED_ORACLE(reference, "reflection_refraction");
    int judged = 0;
    for (const json& c : reference["cases"]) {
        const json &in = c["in"], &out = c["out"];
        const std::string label = c["id"].dump() + " " + c["group"].dump() + " " + c["description"].dump();
        const Vec3 v = material_vec(in["V"]), n = material_vec(in["N"]);
        const double eta = in["n2"].get<double>() / in["n1"].get<double>(), cos_i = -dot(v, n);
        // The reference makes V and N unit before it starts; they are so to a rounding, which a direction keeps.
        expect_near(reflect(v, n), material_vec(out["reflected"]), 1e-15, label);
        const double cos_t = refracted_cosine(cos_i, eta);
        EXPECT_EQ(cos_t < 0, out["tir"] == 1) << label;
        double steep = 1;
        if (out["tir"] == 0) {
            steep = 1 + 1 / out["cos_t"].get<double>();
            expect_near(refract(v, n, eta, cos_t), material_vec(out["transmitted"]), 1e-15 * steep, label);
        }
        EXPECT_NEAR(fresnel_dielectric(cos_i, eta), out["R_fresnel"].get<double>(), 1e-14 * steep) << label;
        EXPECT_NEAR(fresnel_schlick(cos_i, eta), out["R_schlick_general"].get<double>(), 1e-14 * steep) << label;
        ++judged;
    }
    EXPECT_EQ(judged, 32);
}

// The figures of the published comparison: at most 0.060, 0.036 and 0.074 apart when light enters.
TEST(SmoothInterface, SchlickDiffersFromFresnelBySoMuch) {
    const struct { double eta, expected; } cases[] = {{1.33, 0.060}, {1.5, 0.036}, {2.4, 0.074}};
    for (const auto& c : cases) {
        double entering = 0, leaving = 0;
        for (int i = 1; i < 100000; ++i) {
            const double cosine = i * 1e-5;
            entering =
                std::max(entering, std::abs(fresnel_schlick(cosine, c.eta) - fresnel_dielectric(cosine, c.eta)));
            const double inside = refracted_cosine(cosine, c.eta);  // the same ray the other way
            leaving = std::max(
                leaving, std::abs(fresnel_schlick(inside, 1 / c.eta) - fresnel_dielectric(inside, 1 / c.eta)));
        }
        EXPECT_NEAR(entering, c.expected, 5e-4) << c.eta;
        EXPECT_NEAR(leaving, c.expected, 5e-4) << c.eta;
        RecordProperty("largest_difference_" + std::to_string(c.eta), std::to_string(entering));
    }
}

TEST(SmoothInterface, WhatIsNotReflectedGoesThroughAndCancelsOnTheWayOut) {
    Random random(11);
    for (const bool schlick : {false, true})
        for (const float ior : {1.0f, 1.33f, 1.5f, 2.4f, 0.7f}) {
            const TestMaterial glass =
                material("glass", &kinds::dielectric, 0, [&](Material& m) { m.ior = ior, m.schlick = schlick; });
            Surface s = glass.surface();
            for (int i = 0; i < 2000; ++i) {
                s.outside = true;
                const Vec3 v = random.above();
                // All that is not sent back goes through: the share of u[0] on either side is the reflectance.
                const double reflectance = schlick ? fresnel_schlick(v.z, static_cast<double>(ior))
                                                   : fresnel_dielectric(v.z, static_cast<double>(ior));
                if (reflectance > 0) {
                    const BsdfSample back = sample_bsdf(s, kNormal, v, {std::nextafter(reflectance, -1), 0, 0});
                    EXPECT_FALSE(back.transmitted);
                    EXPECT_EQ(back.weight, (Rgb{1, 1, 1}));
                    expect_near(back.l, {-v.x, -v.y, v.z}, 1e-15, "mirror");
                }
                if (reflectance >= 1) continue;
                const BsdfSample in = sample_bsdf(s, kNormal, v, {reflectance, 0, 0});
                ASSERT_TRUE(in.transmitted && in.specular);
                EXPECT_LT(in.l.z, 0);
                EXPECT_NEAR(band(in.weight), 1 / (static_cast<double>(ior) * static_cast<double>(ior)), 1e-6);
                EXPECT_EQ(in.weight.x, in.radiance_scale);
                // Out of a parallel face: the old direction, and no trace of the index.
                s.outside = false;
                const Vec3 from_inside = -in.l;
                const BsdfSample out =
                    sample_bsdf(s, -kNormal, {from_inside.x, from_inside.y, -from_inside.z}, {1 - 0x1p-53, 0, 0});
                ASSERT_TRUE(out.transmitted);
                EXPECT_NEAR(band(in.weight) * band(out.weight), 1, 1e-6);
                EXPECT_EQ(bsdf(s, kNormal, v, v), Rgb{});
                EXPECT_EQ(bsdf_pdf(s, kNormal, v, v), 0);
            }
        }
}

TEST(SmoothInterface, InsideBeyondTheCriticalAngleNothingGoesThrough) {
    const TestMaterial glass = material("glass", &kinds::dielectric, 0, [](Material& m) { m.ior = 1.5f; });
    Surface s = glass.surface();
    s.outside = false;
    const double critical = std::asin(1 / 1.5);
    for (const double degrees : {0.01, 1.0, 20.0, 48.0}) {
        const Vec3 v = at_angle(critical + degrees * kPi / 180);
        EXPECT_FALSE(sample_bsdf(s, kNormal, v, {1 - 0x1p-53, 0, 0}).transmitted) << degrees;
    }
    const BsdfSample just_inside = sample_bsdf(s, kNormal, at_angle(critical - 1e-5), {1 - 0x1p-53, 0, 0});
    EXPECT_TRUE(just_inside.transmitted);
    EXPECT_NEAR(just_inside.l.z, 0, 0.01);
}

TEST(Mirror, ReflectsItsShareIntoOneDirection) {
    const TestMaterial m = material("mirror", &kinds::mirror, 0, [](Material& x) {
        x.specular = {0.9f, 0.6f, 0.3f};
    });
    const Surface s = m.surface();
    EXPECT_TRUE(is_specular(m.material));
    const Vec3 v = at_angle(1.1, 0.4);
    const BsdfSample sample = sample_bsdf(s, kNormal, v, {0.5, 0.5, 0.5});
    expect_near(sample.l, {-v.x, -v.y, v.z}, 1e-15, "mirror");
    EXPECT_EQ(sample.weight, (Rgb{0.9f, 0.6f, 0.3f}));
    EXPECT_TRUE(sample.specular);
    EXPECT_FALSE(sample.transmitted);
    EXPECT_EQ(ambient_reflectance(s), (Rgb{0.9f, 0.6f, 0.3f}));
    EXPECT_EQ(bsdf(s, kNormal, sample.l, v), Rgb{});
}

}  // namespace
}  // namespace narpa
