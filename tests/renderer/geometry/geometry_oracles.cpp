// The tracer against reference numbers from exact and 60-digit arithmetic (a sibling folder of the project).
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/sphere_roots.h"
#include "renderer/integrator/shading.h"
#include "renderer/material/bsdf.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/support/oracle.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using nlohmann::json;
using namespace test;

Vec3 oracle_vec(const json& j) {
    return {j[0], j[1], j[2]};
}

TEST(TracerOracle, RaySphere) {
    NEED_ORACLE(reference, "ray_sphere");
    int judged = 0;
    for (const json& c : reference["cases"]) {
        const json &in = c["in"], &out = c["out"];
        const Vec3 o = oracle_vec(in["origin"]) - oracle_vec(in["center"]), d = oracle_vec(in["dir"]);
        const double radius = in["radius"];
        const auto roots = sphere_roots(o, d, radius);
        const double margin = out["impact_minus_radius"];
        if (std::abs(margin) <= 1e-15 * (norm(o) + radius)) continue;  // either answer is right
        ++judged;
        ASSERT_EQ(roots.any(), out["n_roots"].get<int>() > 0) << c["id"];
        if (!roots.any()) continue;
        const auto bound = [&](double t) {
            return 8 * (0x1p-53 * std::abs(t) + out.value("t_input_ulp_error", 0.0));
        };
        if (!out.contains("t_hit")) {
            EXPECT_LT(roots.far, 0) << c["id"];
            continue;
        }
        const double expected = out["t_hit"], hit = roots.near >= 0 ? roots.near : roots.far;
        EXPECT_LE(std::abs(hit - expected), bound(expected)) << c["id"] << " " << c["description"];
        EXPECT_LE(std::abs(roots.near - out["t_near"].get<double>()), bound(out["t_near"])) << c["id"];
        EXPECT_LE(std::abs(roots.far - out["t_far"].get<double>()), bound(out["t_far"])) << c["id"];
    }
    EXPECT_GT(judged, 40);
}

TEST(TracerOracle, RaySphereThroughTheTracer) {
    NEED_ORACLE(reference, "ray_sphere");
    int judged = 0;
    for (const json& c : reference["cases"]) {
        const json &in = c["in"], &out = c["out"];
        const Vec3 o = oracle_vec(in["origin"]), d = oracle_vec(in["dir"]);
        const double radius = in["radius"], length = norm(d), margin = out["impact_minus_radius"];
        // Making the direction unit rounds it once more: the limb moves by that much.
        if (std::abs(margin) <= 1e-15 * (norm(o - oracle_vec(in["center"])) + radius)) continue;
        Scene s;
        s.materials.push_back(lambert(0.4f));
        add_sphere(s, radius, oracle_vec(in["center"]));
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer);
        const Hit hit = tracer->intersect(placed(s), {o, d / length}, kInfinity);
        ++judged;
        ASSERT_EQ(hit.body >= 0, out.contains("t_hit")) << c["id"] << " " << c["description"];
        if (hit.body < 0) continue;
        const double expected = out["t_hit"].get<double>() * length;
        const double bound = 8 * (0x1p-53 * expected + out["t_input_ulp_error"].get<double>() * length);
        EXPECT_LE(std::abs(hit.range_m - expected), bound) << c["id"] << " " << c["description"];
        // Where the centre is far from the world's origin, a position in the world has that distance's rounding.
        const double rounding = 4e-15 * (norm(o) + norm(oracle_vec(in["center"])) + radius);
        EXPECT_LE(std::abs(norm(hit.position - oracle_vec(in["center"])) - radius), rounding) << c["id"];
    }
    EXPECT_GT(judged, 40);
}

TEST(TracerOracle, RayTriangleAndTheRaysThatEmbreeLoses) {
    NEED_ORACLE(reference, "ray_triangle");
    int judged = 0, leaks = 0;
    for (const json& c : reference["cases"]) {
        const json &in = c["in"], &out = c["out"];
        Scene s;
        Material m = lambert(0.4f);
        m.texture = 0;  // texture coordinates carry the barycentric ones out
        s.materials.push_back(m);
        s.textures.push_back({"white", 1, 1, {65535, 65535, 65535}});
        Mesh mesh;
        const auto add = [&](const Vec3& p, std::array<float, 2> uv) {
            mesh.positions.push_back(vec_cast<float>(p));
            mesh.uvs.push_back(uv);
        };
        add(oracle_vec(in["a"]), {0, 0});
        add(oracle_vec(in["b"]), {1, 0});
        add(oracle_vec(in["c"]), {0, 1});
        if (in.contains("neighbours"))
            for (const json& n : in["neighbours"])
                for (int k = 0; k < 3; ++k) add({n[3 * k], n[3 * k + 1], n[3 * k + 2]}, {0, 0});
        for (std::uint32_t i = 0; i < mesh.positions.size(); i += 3) mesh.faces.push_back({i, i + 1, i + 2});
        mesh.face_material.assign(mesh.faces.size(), 0);
        add_mesh(s, mesh);
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer) << tracer.error().text();
        const Vec3 d = oracle_vec(in["dir"]);
        const Hit hit = tracer->intersect(placed(s), {oracle_vec(in["origin"]), normalized(d)}, kInfinity);
        const std::string label = c["id"].dump() + " " + c["description"].get<std::string>();
        ++judged;
        RayBatch packet;
        packet.n = 1;
        packet.put(0, {oracle_vec(in["origin"]), normalized(d)});
        HitBatch in_packet;
        tracer->intersect(placed(s), packet, tracer->all_bodies(), in_packet);
        EXPECT_EQ(in_packet.body[0], hit.body) << label;
        if (out.contains("any_hit_required") && out["any_hit_required"] == 1) {
            ++leaks;
            EXPECT_GE(hit.body, 0) << label;
        }
        const int kind = out["class"];
        if (kind == 4) {
            EXPECT_LT(hit.body, 0) << label;
            continue;
        }
        const double least = out["min_barycentric"], band = 8 * out["bary_cond_f32"].get<double>();
        if (kind == 0 && least < -band && mesh.faces.size() == 1) {
            EXPECT_LT(hit.body, 0) << label;
        }
        if (kind != 1 || least <= band) continue;
        ASSERT_GE(hit.body, 0) << label;
        const double expected = out["t"].get<double>() * norm(d);
        EXPECT_NEAR(hit.range_m, expected, 8 * out["t_cond_f32"].get<double>() * norm(d)) << label;
        if (hit.face != 0) continue;
        EXPECT_NEAR(hit.u, out["beta"].get<double>(), band + 1e-7) << label;
        EXPECT_NEAR(hit.v, out["gamma"].get<double>(), band + 1e-7) << label;
    }
    EXPECT_EQ(judged, 61);
    EXPECT_GE(leaks, 24);
}

TEST(TracerOracle, SphereUv) {
    NEED_ORACLE(reference, "sphere_uv");
    int judged = 0, turned = 0;
    for (const json& c : reference["cases"]) {
        const json& out = c["out"];
        const Vec3 p = oracle_vec(c["in"]["p"]) - oracle_vec(c["in"]["c"]);
        const auto [u, v] = EllipsoidShape::uv(p);
        EXPECT_NEAR(v, out["v"].get<double>(), 1e-15) << c["id"];
        ++judged;
        if (out.value("u_defined", 1) == 0) continue;
        const double du = std::abs(u - out["u"].get<double>());
        EXPECT_LE(std::min(du, 1 - du), 1e-15) << c["id"] << " " << c["description"];
        EXPECT_GE(u, 0) << c["id"];
        EXPECT_LE(u, 1) << c["id"];  // 1 itself is what rounding leaves of a longitude just below 360 degrees
        ++turned;
    }
    EXPECT_GT(judged, 10);
    EXPECT_GT(turned, 10);
}

/// Directional-hemispherical reflectance of a Phong lobe by quadrature about the mirror direction, with the
/// points as dense as the lobe is high.
double albedo(const Surface& s, double theta) {
    const Vec3 n{0, 0, 1}, v{std::sin(theta), 0, std::cos(theta)}, r{-v.x, 0, v.z};
    const Vec3 x{v.z, 0, v.x}, y{0, 1, 0};
    const int steps = 500;
    const double m = static_cast<double>(s.exponent);
    double sum = 0;
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < steps; ++j) {
            const double cosine = std::pow((i + 0.5) / steps, 1 / (m + 1)), sine = std::sqrt(1 - cosine * cosine);
            const double phi = 2 * std::numbers::pi * (j + 0.5) / steps;
            const Vec3 l = sine * std::cos(phi) * x + sine * std::sin(phi) * y + cosine * r;
            const double density = (m + 1) / (2 * std::numbers::pi) * std::pow(cosine, m);
            sum += static_cast<double>(bsdf(s, n, l, v).x) * std::max(0.0, l.z) / density;
        }
    return sum / (static_cast<double>(steps) * steps);
}

TEST(TracerOracle, PhongAlbedo) {
    NEED_ORACLE(reference, "phong_albedo");
    int judged = 0;
    for (const json& c : reference["cases"]) {
        const double n = c["in"]["n"], expected = c["out"]["albedo_modified_phong"];
        Surface s;
        s.specular = {1, 1, 1};
        s.exponent = static_cast<float>(n);
        const double theta = c["in"]["theta_deg"].get<double>() * std::numbers::pi / 180;
        EXPECT_NEAR(albedo(s, theta), expected, 2e-4) << c["id"];
        ++judged;
    }
    EXPECT_GT(judged, 5);
}

}  // namespace
}  // namespace narpa
