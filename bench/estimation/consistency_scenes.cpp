#include "bench/estimation/consistency_scenes.h"

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "estimator/view/measured_image.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa {
namespace {

using std::numbers::pi;

void append_part(Mesh& to, const Mesh& part, const Rigid3& T) {
    const auto first = static_cast<std::uint32_t>(to.positions.size());
    for (const Vec3f& p : part.positions) to.positions.push_back(vec_cast<float>(T * vec_cast<double>(p)));
    for (const auto& f : part.faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

Mesh box_mesh(const Vec3& size_m) {
    Mesh m;
    for (int i = 0; i < 8; ++i)
        m.positions.push_back(vec_cast<float>(Vec3{((i & 1) - 0.5) * size_m.x, (((i >> 1) & 1) - 0.5) * size_m.y,
                                                   (((i >> 2) & 1) - 0.5) * size_m.z}));
    m.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
               {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return m;
}

/// About the z axis, with `sides` flat faces; many are a cylinder. `smooth`: the shell's normals are a cylinder's.
Mesh prism_mesh(int sides, double radius_m, double height_m, bool smooth) {
    Mesh m;
    const auto vertex = [&](double angle, double z, const Vec3& normal) {
        m.positions.push_back(vec_cast<float>(Vec3{radius_m * std::cos(angle), radius_m * std::sin(angle), z}));
        if (smooth) m.normals.push_back(vec_cast<float>(normal));
        return static_cast<std::uint32_t>(m.positions.size() - 1);
    };
    for (int i = 0; i < sides; ++i) {
        const double a = 2 * pi * i / sides, b = 2 * pi * (i + 1) / sides, z = 0.5 * height_m;
        const Vec3 na{std::cos(a), std::sin(a), 0}, nb{std::cos(b), std::sin(b), 0};
        const auto a0 = vertex(a, -z, na), b0 = vertex(b, -z, nb), a1 = vertex(a, z, na), b1 = vertex(b, z, nb);
        m.faces.insert(m.faces.end(), {{a0, b0, b1}, {a0, b1, a1}});
        for (const double end : {-1.0, 1.0}) {
            const Vec3 n{0, 0, end};
            const auto va = vertex(a, end * z, n), vb = vertex(b, end * z, n);
            m.positions.push_back({0, 0, static_cast<float>(end * z)});
            if (smooth) m.normals.push_back(vec_cast<float>(n));
            const auto centre = static_cast<std::uint32_t>(m.positions.size() - 1);
            if (end > 0)
                m.faces.push_back({centre, va, vb});
            else
                m.faces.push_back({centre, vb, va});
        }
    }
    return m;
}

/// An ellipsoid whose radius varies by the fraction `bump` along rings and columns.
Mesh rounded_mesh(const Vec3& radii_m, double bump, bool smooth) {
    constexpr int kRings = 40, kColumns = 80;
    Mesh m;
    const auto index = [](int ring, int column) {
        return static_cast<std::uint32_t>(ring * kColumns + column % kColumns);
    };
    for (int ring = 0; ring <= kRings; ++ring)
        for (int column = 0; column < kColumns; ++column) {
            const double polar = pi * ring / kRings, around = 2 * pi * column / kColumns;
            const Vec3 n{std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar)};
            const double wave = std::sin(7 * n.x + 1) * std::cos(9 * n.y) + std::sin(13 * n.z + 2 * n.x);
            const double r = 1 + 0.5 * bump * wave;
            m.positions.push_back(
                vec_cast<float>(Vec3{r * radii_m.x * n.x, r * radii_m.y * n.y, r * radii_m.z * n.z}));
            if (smooth)
                m.normals.push_back(
                    vec_cast<float>(normalized(Vec3{n.x / radii_m.x, n.y / radii_m.y, n.z / radii_m.z})));
        }
    for (int ring = 0; ring < kRings; ++ring)
        for (int column = 0; column < kColumns; ++column) {
            const auto a = index(ring, column), b = index(ring, column + 1), c = index(ring + 1, column),
                       d = index(ring + 1, column + 1);
            if (ring > 0) m.faces.push_back({a, c, b});
            if (ring < kRings - 1) m.faces.push_back({b, c, d});
        }
    return m;
}

/// A bus with two panels, a tilted dish and a mast: without any symmetry.
Mesh craft_mesh() {
    Mesh m;
    append_part(m, box_mesh({1.5, 1, 1}), {});
    append_part(m, box_mesh({0.75, 1.7, 0.05}), {exp_rotation({0, 0.4, 0}), {0.15, 1.4, 0}});
    append_part(m, box_mesh({0.75, 1.2, 0.05}), {exp_rotation({0, -0.3, 0}), {-0.1, -1.1, 0.1}});
    append_part(m, box_mesh({0.05, 0.8, 0.8}), {exp_rotation({0, 0.5, 0.4}), {0.95, 0.15, 0.4}});
    append_part(m, box_mesh({0.15, 0.15, 1.2}), {{}, {-0.5, 0.3, 0.9}});
    return m;
}

/// The craft with fifty small boxes on its bus and panels: corners for features.
Mesh detailed_mesh() {
    Mesh m = craft_mesh();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> u(-1, 1);
    for (int i = 0; i < 50; ++i) {
        const Vec3 size{0.06 + 0.1 * std::abs(u(random)), 0.06 + 0.1 * std::abs(u(random)),
                        0.06 + 0.1 * std::abs(u(random))};
        Vec3 at{0.7 * u(random), 0.45 * u(random), 0.45 * u(random)};
        const int axis = i % 3;
        at[axis] = std::copysign(axis == 0 ? 0.75 : 0.5, u(random));
        append_part(m, box_mesh(size), {exp_rotation({0, 0, 0.5 * u(random)}), at});
    }
    return m;
}

struct ConsistencyShape {
    std::string_view name;
    Mesh (*mesh)();
};
constexpr std::array<ConsistencyShape, 8> kShapes{{
    {"detailed", detailed_mesh},
    {"craft", craft_mesh},
    {"cube",
     [] {
         return box_mesh({2, 2, 2});
     }},
    {"brick",
     [] {
         return box_mesh({2.4, 1.6, 1});
     }},
    {"prism", [] { return prism_mesh(6, 1, 2.4, false); }},
    {"cylinder", [] { return prism_mesh(96, 1, 2.4, true); }},
    {"smooth",
     [] {
         return rounded_mesh({1.5, 1.1, 0.9}, 0, true);
     }},
    {"rough",
     [] {
         return rounded_mesh({1.5, 1.1, 0.9}, 0.12, false);
     }},
}};

Result<Scene> scene_of_shape(std::string_view target) {
    for (const ConsistencyShape& t : kShapes) {
        if (t.name != target) continue;
        Scene s;
        s.name = target;
        s.sun = Sun{normalized(Vec3{0.5, -0.4, -0.75}), 1361, 0};
        s.ambient = {8, 8, 8};
        Material grey;
        grey.name = "grey";
        grey.diffuse = {0.3F, 0.3F, 0.3F};
        s.materials.push_back(std::move(grey));
        s.meshes.push_back(t.mesh());
        s.meshes.back().name = target;
        s.meshes.back().face_material.assign(s.meshes.back().faces.size(), 0);
        Body body;
        body.name = target;
        body.shape = 0;
        s.bodies.push_back(std::move(body));
        return s;
    }
    return Error{"no target named \"" + std::string(target) +
                 "\", expected one of the names or a scene file (.toml)"};
}

Result<Scene> scene_of_file(const std::string& file) {
    auto s = read_scene(file);
    if (!s) return s;
    if (s->bodies.empty()) return Error{"has no body, expected a target", file};
    s->bodies.resize(1);
    s->lights.clear();
    s->lidars.clear();
    return s;
}

}  // namespace

std::vector<std::string_view> consistency_targets() {
    std::vector<std::string_view> names;
    for (const ConsistencyShape& t : kShapes) names.push_back(t.name);
    return names;
}

Result<Scene> consistency_scene(std::string_view target, int size) {
    Result<Scene> s = target.ends_with(".toml") ? scene_of_file(std::string(target)) : scene_of_shape(target);
    if (!s) return s;
    Camera c;
    c.name = "camera";
    c.width = c.height = size;
    c.model = std::make_shared<const Pinhole>(1.6 * size, 1.6 * size, 0.5 * (size - 1), 0.5 * (size - 1));
    c.format = PixelFormat::y16;
    c.detector = Detector{.exposure_s = 3e-5,
                          .pixel_pitch_m = 5e-6,
                          .f_number = 4,
                          .quantum_efficiency = 0.5,
                          .full_well_e = 20000,
                          .read_noise_e = 12,
                          .shot_noise = true,
                          .black_level_dn = 32,
                          .bits = 12};
    s->cameras = {std::move(c)};
    return s;
}

std::vector<float> sampling_variance(ModelView& view, const Rigid3& T_camera_target, FrameSettings settings,
                                     std::mt19937_64& random) {
    constexpr int kFrames = 4;
    const auto& [r, g, b] = sensor_model(view.camera()).dn_per_radiance;
    const double dn_per_mean = r + g + b;
    std::vector<float> sum(view.radiance().pixels.size(), 0);
    for (int k = 0; k < kFrames; ++k) {
        settings.seed = random();
        view.render_with_variance(T_camera_target, settings);
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += view.aovs().variance[i];
    }
    for (float& v : sum) v *= static_cast<float>(dn_per_mean * dn_per_mean / kFrames);
    return sum;
}

}  // namespace narpa
