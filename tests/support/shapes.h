/// tests/support/shapes.h - scenes made in code: shapes whose light and ranges have closed forms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "base/constants.h"
#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/tracer.h"
#include "renderer/scene/scene.h"
#include "tests/support/cameras.h"

namespace narpa::test {

/// A geodesic sphere of 20 * 4^level triangles; `smooth` gives it the sphere's own normals at the vertices.
inline Mesh icosphere(int level, double radius_m, bool smooth = false) {
    const double g = (1 + std::sqrt(5.0)) / 2;
    std::vector<Vec3> p{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                        {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    for (Vec3& v : p) v = normalized(v);
    using Face = std::array<std::uint32_t, 3>;
    std::vector<Face> faces{{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                            {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                            {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (int l = 0; l < level; ++l) {
        std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
        const auto middle = [&](std::uint32_t a, std::uint32_t b) {
            const auto [at, fresh] =
                middles.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<std::uint32_t>(p.size()));
            if (fresh) p.push_back(normalized(p[a] + p[b]));
            return at->second;
        };
        std::vector<Face> finer;
        for (const auto& [a, b, c] : faces) {
            const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
        }
        faces = std::move(finer);
    }
    Mesh m;
    m.name = "icosphere";
    for (const Vec3& v : p) {
        m.positions.push_back(vec_cast<float>(radius_m * v));
        if (smooth) m.normals.push_back(vec_cast<float>(v));
    }
    m.faces = std::move(faces);
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

/// A closed, bumpy body: an icosphere whose radius waves by `bump` of itself.
inline Mesh bumpy(int level, double radius_m, double bump) {
    Mesh m = icosphere(level, radius_m);
    m.name = "bumpy";
    for (Vec3f& p : m.positions) {
        const Vec3 n = normalized(vec_cast<double>(p));
        const double wave = std::sin(7 * n.x + 1) * std::cos(9 * n.y) + std::sin(13 * n.z + 2 * n.x);
        p = vec_cast<float>(radius_m * (1 + 0.5 * bump * wave) * n);
    }
    return m;
}

/// A rectangle in the plane z = 0, facing +z, with texture coordinates 0..1 along x and y.
inline Mesh plate(double width_m, double height_m, int cells = 1) {
    Mesh m;
    m.name = "plate";
    const int n = cells + 1;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const double u = static_cast<double>(i) / cells, v = static_cast<double>(j) / cells;
            m.positions.push_back(vec_cast<float>(Vec3{(u - 0.5) * width_m, (v - 0.5) * height_m, 0}));
            m.uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
        }
    for (int j = 0; j < cells; ++j)
        for (int i = 0; i < cells; ++i) {
            const auto at = [&](int x, int y) { return static_cast<std::uint32_t>(y * n + x); };
            m.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            m.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

/// Adds a box about T's origin that faces outwards, without materials.
inline void append_box(Mesh& m, const Vec3& size_m, const Rigid3& T) {
    const auto first = static_cast<std::uint32_t>(m.positions.size());
    for (int i = 0; i < 8; ++i)
        m.positions.push_back(
            vec_cast<float>(T * Vec3{((i & 1) - 0.5) * size_m.x, (((i >> 1) & 1) - 0.5) * size_m.y,
                                     (((i >> 2) & 1) - 0.5) * size_m.z}));
    using Face = std::array<std::uint32_t, 3>;
    for (const Face& f : {Face{0, 2, 1},
                          {1, 2, 3},
                          {4, 5, 6},
                          {5, 7, 6},
                          {0, 1, 4},
                          {1, 5, 4},
                          {2, 6, 3},
                          {3, 6, 7},
                          {0, 4, 2},
                          {2, 4, 6},
                          {1, 3, 5},
                          {3, 7, 5}})
        m.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

/// An axis-aligned box about the origin, facing outwards.
inline Mesh box(double x_m, double y_m, double z_m) {
    Mesh m;
    m.name = "box";
    append_box(m, {x_m, y_m, z_m}, {});
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

inline Material lambert(float albedo) {
    Material m;
    m.name = "lambert";
    m.diffuse = {albedo, albedo, albedo};
    return m;
}

/// Adds a body; returns its index. The mesh's faces use material 0 unless they say otherwise.
inline int add_mesh(Scene& s, Mesh mesh, const Rigid3& T_world_body = {}) {
    s.meshes.push_back(std::move(mesh));
    Body b;
    b.name = s.meshes.back().name + std::to_string(s.bodies.size());
    b.shape = static_cast<int>(s.meshes.size()) - 1;
    b.initial.T_world_body = T_world_body;
    s.bodies.push_back(std::move(b));
    return static_cast<int>(s.bodies.size()) - 1;
}
inline int add_sphere(Scene& s, double radius_m, const Vec3& centre, int material = 0) {
    Body b;
    b.name = "sphere" + std::to_string(s.bodies.size());
    b.shape = exact_sphere(radius_m, material);
    b.initial.T_world_body.t = centre;
    s.bodies.push_back(std::move(b));
    return static_cast<int>(s.bodies.size()) - 1;
}
inline void add_sun(Scene& s, const Vec3& direction, double irradiance_w_m2 = 1361) {
    Sun sun;
    sun.direction = normalized(direction);
    sun.irradiance_w_m2 = irradiance_w_m2;
    s.sun = sun;
}

/// A camera of this focal length in pixels, its axis through the middle of the image.
inline Camera camera(int width, int height, double focal_px) {
    Camera c;
    c.name = "camera";
    c.width = width;
    c.height = height;
    set_pinhole(c, focal_px, focal_px, (width - 1) / 2.0, (height - 1) / 2.0);
    c.white_radiance = 1361 / 3.14159265358979323846;
    return c;
}

/// A bumpy grey body, about a metre in radius.
inline Scene sunlit_bumpy_body() {
    Scene scene;
    scene.materials.push_back(lambert(0.7f));
    add_mesh(scene, bumpy(4, 1, 0.3));
    add_sun(scene, {0.5, -0.6, -1});
    return scene;
}

/// All bodies where the scene puts them at time 0, moved by `offset`.
inline BodyPoses placed(const Scene& s, const Vec3& offset = {}) {
    BodyPoses at(s.bodies.size());
    for (std::size_t i = 0; i < s.bodies.size(); ++i) {
        Rigid3 T = s.bodies[i].initial.T_world_body;
        T.t += offset;
        at.set(i, T);
    }
    return at;
}

/// A pose at `eye` that points along z at `target`, with image down away from `up`.
inline Rigid3 looking(const Vec3& eye, const Vec3& target, const Vec3& up = {0, 0, 1}) {
    const Vec3 z = normalized(target - eye), x = normalized(cross(z, up));
    return {quat_from_columns(x, cross(z, x), z), eye};
}

inline Vec3 random_direction(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Vec3{n(random), n(random), n(random)});
}
inline Quat random_attitude(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Quat{n(random), n(random), n(random), n(random)});
}

}  // namespace narpa::test
