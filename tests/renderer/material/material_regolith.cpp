// Soils of airless bodies: phase curves of whole discs against their closed forms, and published albedos.
#include <gtest/gtest.h>

#include "renderer/material/albedo.h"
#include "renderer/material/regolith.h"
#include "tests/renderer/material/material_support.h"

namespace narpa {
namespace {

using namespace test;

/// What a unit sphere under irradiance 1 sends to a far viewer at phase angle a; a flat Lambert disc of albedo 1
/// that faces both sends 1, so this is the geometric albedo times the phase function. Photometric latitude and
/// longitude; midpoints, dense towards terminator and limb.
double disc(const TestMaterial& m, double phase, int steps = 200) {
    const Surface s = m.surface();
    const Vec3 to_viewer{1, 0, 0}, to_sun{std::cos(phase), std::sin(phase), 0};
    double sum = 0;
    const double from = phase - kPi / 2, width = kPi - phase;  // lit and seen
    for (int i = 0; i < steps; ++i) {
        const double x = (i + 0.5) / steps, longitude = from + width * x * x * (3 - 2 * x);
        for (int j = 0; j < steps / 2; ++j) {
            const double y = (j + 0.5) / (steps / 2), latitude = kPi / 2 * (1 - (1 - y) * (1 - y));
            const double weight = std::cos(latitude) * 6 * x * (1 - x) * width * kPi * (1 - y);
            const Vec3 n{std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                         std::sin(latitude)};
            const double mu = dot(n, to_viewer), mu0 = dot(n, to_sun);
            if (mu > 0 && mu0 > 0) sum += band(bsdf(s, n, to_sun, to_viewer)) * mu * mu0 * weight;
        }
    }
    return 2 * sum / (static_cast<double>(steps) * (steps / 2));  // both hemispheres of latitude
}

/// Spherical albedo: 2 * integral of the phase curve times sin a.
double bond_albedo(const TestMaterial& m) {
    const int steps = 60;
    double sum = 0;
    for (int i = 0; i < steps; ++i) {
        const double a = kPi * (i + 0.5) / steps;
        sum += disc(m, a, 80) * 2 * std::sin(a) * kPi / steps;
    }
    return sum;
}

double lambert_phase(double a) {
    return (std::sin(a) + (kPi - a) * std::cos(a)) / kPi;
}
double seeliger_phase(double a) {
    return a == 0 ? 1 : 1 + std::sin(a / 2) * std::tan(a / 2) * std::log(std::tan(a / 4));
}
constexpr double kPhaseAngles[] = {0, 1, 5, 20, 45, 70, 90, 120, 150, 170};

TEST(DiscIntegrated, LambertSphereTo0_1PerCent) {
    const TestMaterial m = material("lambert", &kinds::lambert, 0.6);
    for (const double degrees : kPhaseAngles) {
        const double a = degrees * kPi / 180, expected = 0.6 * 2 / 3 * lambert_phase(a);
        EXPECT_NEAR(disc(m, a), expected, 1e-3 * expected) << degrees;
    }
    EXPECT_NEAR(bond_albedo(m), 0.6, 2e-3 * 0.6);
}

// p(a) w / 8 (1 - sin(a/2) tan(a/2) ln cot(a/4)): Seeliger 1884; e.g. K. Muinonen et al., Planet. Space Sci. 118,
// 227 (2015).
TEST(DiscIntegrated, LommelSeeligerSphereTo0_1PerCent) {
    for (const float g : {0.0f, -0.3f, 0.2f, -0.6f}) {
        const TestMaterial m =
            material("seeliger", &kinds::lommel_seeliger, 0.4, [&](Material& x) { x.asymmetry = g; });
        for (const double degrees : kPhaseAngles) {
            const double a = degrees * kPi / 180, asymmetry = static_cast<double>(g);
            const double particle = (1 - asymmetry * asymmetry) /
                                    std::pow(1 + asymmetry * asymmetry + 2 * asymmetry * std::cos(a), 1.5);
            const double expected = 0.4 / 8 * particle * seeliger_phase(a);
            EXPECT_NEAR(disc(m, a), expected, 1e-3 * expected) << g << " at " << degrees;
        }
        EXPECT_NEAR(lommel_seeliger_bond_albedo(static_cast<double>(g)) * 0.4, bond_albedo(m),
                    3e-3 * bond_albedo(m))
            << g;
    }
    EXPECT_NEAR(lommel_seeliger_bond_albedo(0), 2 * (1 - std::log(2.0)) / 3, 1e-8);
}

// Its directional albedo: w / 2 (1 - mu ln((1 + mu) / mu)).
TEST(LommelSeeliger, DirectionalAlbedoIsItsClosedForm) {
    const TestMaterial m = material("seeliger", &kinds::lommel_seeliger, 0.8);
    for (const double mu : {0.05, 0.3, 0.7, 1.0}) {
        const double expected = 0.4 * (1 - mu * std::log((1 + mu) / mu));
        EXPECT_NEAR(albedo(m, at_angle(std::acos(mu))), expected, 2e-3 * expected) << mu;
    }
}

// A / pi * cos(a / 2) times the integrals over longitude, 2 (pi - a) / pi, and latitude, of cos^p with p = 2 + a /
// (pi - a): sqrt(pi) Gamma((p + 1) / 2) / Gamma(p / 2 + 1).
TEST(DiscIntegrated, AkimovSphereTo0_1PerCent) {
    const TestMaterial m = material("akimov", &kinds::akimov, 0.12);
    for (const double degrees : kPhaseAngles) {
        const double a = degrees * kPi / 180, p = 2 + a / (kPi - a);
        const double latitude = std::sqrt(kPi) * std::tgamma((p + 1) / 2) / std::tgamma(p / 2 + 1);
        const double expected = 0.12 / kPi * std::cos(a / 2) * 2 * (kPi - a) / kPi * latitude;
        EXPECT_NEAR(disc(m, a), expected, 1e-3 * expected) << degrees;
    }
}

// The radiance factor pi f n.l over the albedo is the disk function, here in photometric latitude and longitude.
TEST(Akimov, IsTheDiskFunctionInPhotometricCoordinates) {
    const TestMaterial m = material("akimov", &kinds::akimov, 0.3);
    const Surface s = m.surface();
    const Vec3 v{1, 0, 0};
    for (const double a : {1e-7, 0.02, 0.7, 1.5, 2.6, 3.1})
        for (const double latitude : {0.0, 0.5, 1.4})
            for (const double place : {0.01, 0.3, 0.5, 0.9, 0.99}) {
                const double longitude = a - kPi / 2 + place * (kPi - a);  // from terminator to limb
                const Vec3 n{std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                             std::sin(latitude)};
                const Vec3 l{std::cos(a), std::sin(a), 0};
                const double expected = std::cos(a / 2) * std::cos(kPi / (kPi - a) * (longitude - a / 2)) *
                                        std::pow(std::cos(latitude), a / (kPi - a)) / std::cos(longitude);
                EXPECT_NEAR(band(bsdf(s, n, l, v)) * kPi * dot(n, l) / 0.3, expected, 1e-5 * (1 + expected))
                    << a << " " << latitude << " " << place;
            }
    const Vec3 n = at_angle(1.2);
    EXPECT_NEAR(band(bsdf(s, n, v, v)) * kPi * dot(n, v), 0.3, 1e-6) << "flat at full phase";
}

TEST(Akimov, SendsBackNoMoreThanItGetsBelowItsLargestAlbedo) {
    const Rgb largest = largest_albedo(material("akimov", &kinds::akimov, 1).material);
    double most = 0;
    for (double degrees = 60; degrees < 89.9; degrees += 0.5)
        most = std::max(most, albedo(material("akimov", &kinds::akimov, 1), at_angle(degrees * kPi / 180)));
    EXPECT_LE(most, band(largest) * 1.001);
    EXPECT_GE(most, band(largest) * 0.998);
}

TEST(HenyeyGreenstein, HasMeanOneAndItsAsymmetry) {
    for (const double g : {-0.9, -0.5, -0.1, 0.0, 1e-9, 0.3, 0.8}) {
        double mean = 0, cosine = 0, sampled = 0;
        const int steps = 200000;
        for (int i = 0; i < steps; ++i) {
            const double x = 2 * (i + 0.5) / steps - 1;
            mean += henyey_greenstein(g, x) / steps;
            cosine += henyey_greenstein(g, x) * -x / steps;  // the scattering angle is pi - a
            sampled -= henyey_greenstein_cosine(g, (i + 0.5) / steps) / steps;
        }
        EXPECT_NEAR(mean, 1, 1e-6) << g;
        EXPECT_NEAR(cosine, g, 1e-6) << g;
        EXPECT_NEAR(sampled, g, 1e-6) << g;
    }
}

// McEwen 1996: at full phase a Lommel-Seeliger disc, without limb darkening, of the normal albedo; further on a
// mixture whose disc is that of its two parts.
TEST(LunarLambert, IsFlatAtFullPhaseAndMixesBeyond) {
    const TestMaterial m = material("moon", &kinds::lunar_lambert, 0.12);
    const Surface s = m.surface();
    for (const double degrees : {0.0, 30.0, 60.0, 85.0}) {
        const Vec3 v = at_angle(degrees * kPi / 180);
        EXPECT_NEAR(band(bsdf(s, {0, 0, 1}, v, v)) * kPi * v.z, 0.12, 1e-5) << degrees;
    }
    EXPECT_NEAR(disc(m, 0), 0.12, 2e-4 * 0.12);
    for (const double degrees : {5.0, 30.0, 60.0, 90.0, 120.0}) {
        const double a = degrees * kPi / 180;
        const double weight = degrees > 103.95 ? 0
                                               : 1 - 0.019 * degrees + 2.42e-4 * degrees * degrees -
                                                     1.46e-6 * degrees * degrees * degrees;
        const double expected = 0.12 * (weight * seeliger_phase(a) + (1 - weight) * 2 / 3 * lambert_phase(a));
        EXPECT_NEAR(disc(m, a), expected, 1e-3 * expected) << degrees;
    }
    EXPECT_GT(lunar_lambert_weight(103.9 * kPi / 180), 0);
    EXPECT_EQ(lunar_lambert_weight(104.0 * kPi / 180), 0);
    EXPECT_NEAR(albedo(m, at_angle(89.99 * kPi / 180)), 0.12 * kLunarLambertLargest,
                0.003 * 0.12 * kLunarLambertLargest);
}

/// Chandrasekhar's H for isotropic scattering, by iterating its integral equation on Gauss-like points.
struct ExactH {
    std::vector<double> nodes, weights, values;
    double w;

    explicit ExactH(double albedo) : w(albedo) {
        const int count = 300;
        for (int i = 0; i < count; ++i) {
            const double t = (i + 0.5) / count;
            nodes.push_back(t * t);
            weights.push_back(2 * t / count);
            values.push_back(1);
        }
        for (int k = 0; k < 400; ++k)
            for (std::size_t i = 0; i < nodes.size(); ++i) values[i] = at(nodes[i]);
    }
    // The form that converges for w = 1: 1 / H = sqrt(1 - w) + w / 2 * integral of m H(m) / (m + mu) dm.
    [[nodiscard]] double at(double mu) const {
        double sum = 0;
        for (std::size_t i = 0; i < nodes.size(); ++i) sum += weights[i] * nodes[i] * values[i] / (nodes[i] + mu);
        return 1 / (std::sqrt(1 - w) + w / 2 * sum);
    }
};

// Isotropic grains, no opposition peak, smooth: then Chandrasekhar's solution is exact, and Hapke's H, as
// published, within 1 per cent of it.
TEST(Hapke, IsotropicGrainsMeetChandrasekharsSolution) {
    EXPECT_NEAR(ExactH(1).at(1), 2.9078, 2e-3);  // S. Chandrasekhar, "Radiative Transfer", table XI
    for (const double w : {0.1, 0.5, 0.9, 1.0}) {
        const ExactH h(w);
        const TestMaterial m = material("hapke", &kinds::hapke, w, [](Material& x) {
            x.hapke = {0, 0, 0, 0.05f, 0};
        });
        Random random(8);
        for (int i = 0; i < 300; ++i) {
            const Vec3 l = random.above(), v = random.above();
            const double expected = w / (4 * kPi) / (l.z + v.z) * h.at(l.z) * h.at(v.z);
            EXPECT_NEAR(band(bsdf(m.surface(), {0, 0, 1}, l, v)), expected, 0.02 * expected) << w;
        }
    }
}

// Hapke 2012, chapter 11: his disc-integrated closed form for a smooth surface, whose H is the cruder (1 + 2 x) /
// (1 + 2 gamma x): 4 per cent apart for bright grains, 1 for dark ones.
TEST(Hapke, SmoothSphereMeetsItsDiscIntegratedForm) {
    for (const double w : {0.05, 0.3, 0.7}) {
        const Hapke parameters{0.3f, 0.5f, 0.8f, 0.08f, 0};
        const TestMaterial m = material("hapke", &kinds::hapke, w, [&](Material& x) { x.hapke = parameters; });
        const double gamma = std::sqrt(1 - w), r0 = (1 - gamma) / (1 + gamma);
        for (const double degrees : {0.0, 2.0, 10.0, 40.0, 80.0, 120.0, 150.0}) {
            const double a = degrees * kPi / 180, b = 0.3, c = 0.5;
            const auto lobe = [&](double g) {
                return (1 - g * g) / std::pow(1 + g * g + 2 * g * std::cos(a), 1.5);
            };
            const double p = (1 + c) / 2 * lobe(-b) + (1 - c) / 2 * lobe(b);
            const double surge = 0.8 / (1 + std::tan(a / 2) / 0.08);
            const double expected = (w / 8 * ((1 + surge) * p - 1) + r0 / 2 * (1 - r0)) * seeliger_phase(a) +
                                    2.0 / 3 * r0 * r0 * lambert_phase(a);
            EXPECT_NEAR(disc(m, a), expected, (w < 0.1 ? 0.01 : 0.04) * expected) << w << " at " << degrees;
        }
    }
}

TEST(Hapke, DarkGrainsAreLommelSeeligerAndSlopesVanishWithTheirAngle) {
    const TestMaterial dark = material("dark", &kinds::hapke, 1e-4, [](Material& m) {
        m.hapke = {0.4f, 1, 0, 0.05f, 0};
    });
    const TestMaterial seeliger =
        material("seeliger", &kinds::lommel_seeliger, 1e-4, [](Material& m) { m.asymmetry = -0.4f; });
    const TestMaterial smooth = material("smooth", &kinds::hapke, 0.4, [](Material& m) {
        m.hapke = {0.3f, 0.5f, 1, 0.1f, 0};
    });
    const TestMaterial slopes = material("slopes", &kinds::hapke, 0.4, [](Material& m) {
        m.hapke = {0.3f, 0.5f, 1, 0.1f, 1e-4f};
    });
    Random random(9);
    for (int i = 0; i < 2000; ++i) {
        const Vec3 n{0, 0, 1}, l = random.above(), v = random.above();
        const double f = band(bsdf(dark.surface(), n, l, v)), g = band(bsdf(smooth.surface(), n, l, v));
        EXPECT_NEAR(f, band(bsdf(seeliger.surface(), n, l, v)), 3e-4 * f);
        if (std::min(l.z, v.z) > 0.02) {
            EXPECT_NEAR(g, band(bsdf(slopes.surface(), n, l, v)), 0.006 * g);
        }
    }
}

// Slopes shadow each other: less light comes back off normal incidence than from a smooth soil, most at large
// phase; the disc at full phase changes little (Hapke 1984: normal albedo of dark soils does not depend on
// theta-bar).
TEST(Hapke, SlopesDarkenLargePhases) {
    const auto soil = [](float roughness) {
        return material("soil", &kinds::hapke, 0.2, [=](Material& m) {
            m.hapke = {0.3f, 0.5f, 0, 0.1f, roughness};
        });
    };
    const TestMaterial smooth = soil(0), rough = soil(0.4f);
    const auto ratio = [&](double degrees) {
        return disc(rough, degrees * kPi / 180) / disc(smooth, degrees * kPi / 180);
    };
    EXPECT_GT(ratio(0), 0.9);
    EXPECT_LT(ratio(60), ratio(20));
    EXPECT_LT(ratio(100), ratio(60));
    EXPECT_LT(ratio(120), 0.6);
    const Vec3 n{0, 0, 1};
    EXPECT_NEAR(band(bsdf(rough.surface(), n, n, n)), band(bsdf(smooth.surface(), n, n, n)),
                0.02 * band(bsdf(smooth.surface(), n, n, n)));
}

/// A body's published parameters for Material::hapke, with the single scattering albedo w for Material::diffuse.
struct PublishedHapke {
    const char* body;
    float single_scattering_albedo;
    Hapke parameters;
    double geometric_albedo;  ///< as published beside them
    const char* source;
};

/// One-term Henyey-Greenstein fits of asymmetry g are phase_b = -g, phase_c = 1 here.
inline constexpr PublishedHapke kPublishedHapke[] = {
    {"433 Eros, 550 nm",
     0.33f,
     {0.25f, 1, 1.4f, 0.010f, 0.4887f},
     0.23,
     "J.-Y. Li, M. A'Hearn, L. McFadden, Icarus 172, 415 (2004): w 0.33, g -0.25, B0 1.4, h 0.010, theta-bar 28 "
     "deg"},
    {"9P/Tempel 1, 550 nm",
     0.039f,
     {0.49f, 1, 1.0f, 0.01f, 0.2793f},
     0.056,
     "J.-Y. Li et al., Icarus 187, 41 (2007): w 0.039, g -0.49, B0 1.0, h 0.01, theta-bar 16 deg"},
};

// The parameters give back the geometric albedo that their authors published with them, to its last digit.
TEST(Hapke, PublishedParametersGiveThePublishedAlbedo) {
    for (const PublishedHapke& body : kPublishedHapke) {
        const TestMaterial m =
            material(body.body, &kinds::hapke, static_cast<double>(body.single_scattering_albedo),
                     [&](Material& x) { x.hapke = body.parameters; });
        EXPECT_NEAR(disc(m, 0), body.geometric_albedo, body.geometric_albedo > 0.1 ? 0.005 : 0.0005) << body.body;
    }
}

}  // namespace
}  // namespace narpa
