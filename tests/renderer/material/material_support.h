// Materials to test, random numbers, and integrals over directions.
#pragma once

#include <cmath>
#include <functional>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "base/constants.h"
#include "renderer/material/bsdf_kind.h"
#include "renderer/material/directions.h"

namespace narpa::test {

inline constexpr Vec3 kNormal{0, 0, 1};

/// A surface with the material it points to.
struct TestMaterial {
    std::string name;
    Material material;

    [[nodiscard]] Surface surface() const {
        Surface s{material.diffuse, {}, {}, material.exponent, &material, {0, 0, 1}, true};
        if (material.kind == &kinds::phong) s.specular = material.specular;
        return s;
    }
};

inline std::ostream& operator<<(std::ostream& out, const TestMaterial& m) {
    return out << m.name;
}

inline Rgb grey(double value) {
    const float v = static_cast<float>(value);
    return {v, v, v};
}

inline TestMaterial material(std::string name, const BsdfKind* kind, double diffuse,
                             const std::function<void(Material&)>& rest = {}) {
    TestMaterial m{std::move(name), {}};
    m.material.kind = kind;
    m.material.diffuse = grey(diffuse);
    if (rest) rest(m.material);
    return m;
}

/// One or more of each kind that scatters, none with lobes narrower than some degrees.
inline std::vector<TestMaterial> broad_materials() {
    const auto phong = [](double ks, float n) {
        return [=](Material& m) { m.specular = grey(ks), m.exponent = n; };
    };
    const auto ggx = [](float roughness, float metallic, float ior = 1.5f, bool schlick = false) {
        return
            [=](Material& m) { m.roughness = roughness, m.metallic = metallic, m.ior = ior, m.schlick = schlick; };
    };
    const auto hapke = [](Hapke h) { return [=](Material& m) { m.hapke = h; }; };
    return {
        material("lambert", &kinds::lambert, 0.7),
        material("phong_lobe_0", &kinds::phong, 0, phong(0.9, 0)),
        material("phong_lobe_1", &kinds::phong, 0, phong(1, 1)),
        material("phong_mixed", &kinds::phong, 0.4, phong(0.5, 40)),
        material("phong_narrow", &kinds::phong, 0.1, phong(0.8, 300)),
        material("ggx_metal_0.3", &kinds::ggx, 0.9, ggx(0.3f, 1)),
        material("ggx_metal_0.6", &kinds::ggx, 1, ggx(0.6f, 1)),
        material("ggx_metal_1", &kinds::ggx, 1, ggx(1, 1)),
        material("ggx_dielectric_0.3", &kinds::ggx, 0.8, ggx(0.3f, 0)),
        material("ggx_dielectric_0.8", &kinds::ggx, 1, ggx(0.8f, 0, 2.0f)),
        material("ggx_schlick", &kinds::ggx, 0.5, ggx(0.5f, 0, 1.33f, true)),
        material("ggx_half_metal", &kinds::ggx, 0.6, ggx(0.4f, 0.5f)),
        material("lommel_seeliger", &kinds::lommel_seeliger, 0.8),
        material("lommel_seeliger_backward", &kinds::lommel_seeliger, 0.5,
                 [](Material& m) { m.asymmetry = -0.4f; }),
        material("lommel_seeliger_forward", &kinds::lommel_seeliger, 0.5, [](Material& m) { m.asymmetry = 0.3f; }),
        material("lunar_lambert", &kinds::lunar_lambert, 0.12),
        material("akimov", &kinds::akimov, 0.12),
        material("hapke_isotropic", &kinds::hapke, 0.9, hapke({0, 0, 0, 0.05f, 0})),
        material("hapke_smooth", &kinds::hapke, 0.5, hapke({0.3f, 0.4f, 1.0f, 0.1f, 0})),
        material("hapke_rough", &kinds::hapke, 0.33, hapke({0.25f, 1.0f, 1.4f, 0.05f, 0.489f})),
    };
}

inline Vec3 at_angle(double theta, double phi = 0) {
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double operator()() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    std::array<double, 3> three() { return {(*this)(), (*this)(), (*this)()}; }
    Vec3 above() { return direction_at((*this)(), (*this)()); }

private:
    std::mt19937_64 engine_;
};

/// Integral over the hemisphere about +z of g, on points that are dense about `peak`: a polar angle t^3 about it,
/// so that lobes of a degree are resolved.
inline double integral(const Vec3& peak, const std::function<double(const Vec3&)>& g, int steps = 600) {
    const Basis frame(peak);
    double sum = 0;
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < steps / 2; ++j) {
            const double t = (i + 0.5) / steps, theta = kPi * t * t * t;
            const Vec3 l = frame.to_world(direction_at(std::cos(theta), (j + 0.5) / (steps / 2)));
            if (l.z > 0) sum += g(l) * std::sin(theta) * 3 * kPi * t * t;
        }
    return sum * 2 * kPi / (static_cast<double>(steps) * (steps / 2));
}

/// Where the narrowest part of the material's f lies.
inline Vec3 peak_of(const Material& m, const Vec3& v) {
    return m.kind->lambert_or_phong || m.kind == &kinds::ggx || m.kind->direct_only ? Vec3{-v.x, -v.y, v.z} : v;
}

inline double band(const Rgb& c) {
    return static_cast<double>(c.x);
}

inline double albedo(const TestMaterial& m, const Vec3& v, int steps = 600) {
    const Surface s = m.surface();
    return integral(
        peak_of(m.material, v),
        [&](const Vec3& l) {
            return band(bsdf(s, {0, 0, 1}, l, v)) * l.z;
        },
        steps);
}

}  // namespace narpa::test
