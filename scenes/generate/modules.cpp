#include "scenes/generate/modules.h"

#include <algorithm>

#include "scenes/generate/textures.h"

namespace narpa::scenes {
namespace {

/// Frame on the side of a cylinder about T's x axis: x along the axis, z outwards.
Rigid3 on_side(const Rigid3& T, double a, double r, double angle) {
    return T * Rigid3{exp_rotation({angle - kPi / 2, 0, 0}), {a, r * std::cos(angle), r * std::sin(angle)}};
}
Rigid3 turned_about_z(const Rigid3& T, double angle) {
    return T * Rigid3{exp_rotation({0, 0, angle}), {}};
}

/// Frame ring around a hull, from a0 to a1, standing `height` over radius r.
void ring(Mesh& mesh, const Rigid3& T, double a0, double a1, double r, double height, int segments) {
    lathe(mesh, T, {{a0, r - 0.03}, {a0, r + height}, {a1, r + height}, {a1, r - 0.03}, {a0, r - 0.03}}, segments);
}

}  // namespace

void shield_belt(Mesh& mesh, const Rigid3& T, const ShieldBelt& belt, Random& random) {
    const double gap_m = 0.03, thickness_m = 0.035, span = 2 * kPi / belt.count;
    const double slope = std::hypot(belt.a1 - belt.a0, belt.r1 - belt.r0);
    // Outward normal of the cone in the (a, r) plane.
    const double na = -(belt.r1 - belt.r0) / slope, nr = (belt.a1 - belt.a0) / slope;
    for (int k = 0; k < belt.count; ++k) {
        const int cell = random.below(kPanelsPerSide * kPanelsPerSide);
        const double u0 = (cell % kPanelsPerSide) / double(kPanelsPerSide),
                     v0 = (cell / kPanelsPerSide) / double(kPanelsPerSide);
        const bool flip = random.uniform() < 0.5;
        const double dome_m = random.uniform(0.004, 0.016), lift_m = random.uniform(-0.006, 0.006);
        const double margin = 0.5 * gap_m / slope;
        plate(mesh, {8,
                     6,
                     0.012,
                     0.012,
                     [&](double u, double v, double w) {
                         const double f = margin + v * (1 - 2 * margin);
                         const double r = belt.r0 + f * (belt.r1 - belt.r0), a = belt.a0 + f * (belt.a1 - belt.a0);
                         const double angle =
                             (k + 0.5) * span + (u - 0.5) * (span - gap_m / std::max(belt.r0, belt.r1));
                         const double relief = dome_m * 16 * u * (1 - u) * v * (1 - v) * (w == 1);
                         const double height = -0.01 + w * (thickness_m + 0.01 + lift_m) + relief;
                         return T * Vec3{a + na * height, (r + nr * height) * std::cos(angle),
                                         (r + nr * height) * std::sin(angle)};
                     },
                     [&](double u, double v) {
                         const double inset = 0.5 / 128;  // half a texel: the neighbour in the atlas stays out
                         const double x = inset + (flip ? 1 - u : u) * (1 - 2 * inset);
                         const double y = inset + (flip ? 1 - v : v) * (1 - 2 * inset);
                         return Uv{u0 + x / kPanelsPerSide, v0 + y / kPanelsPerSide};
                     },
                     {}});
    }
}

void module(Mesh& mesh, const Rigid3& T, const Module& m, Random& random) {
    const double a0 = m.cone_length, a1 = m.length - m.cone_length, row = (a1 - a0) / m.rows;
    mesh.material("grey_hull");
    lathe(mesh, T,
          {{0, 0}, {0, m.neck_radius}, {a0, m.radius}, {a1, m.radius}, {m.length, m.neck_radius}, {m.length, 0}},
          96);
    mesh.material("aluminium");
    ring(mesh, T, -0.06, 0.08, m.neck_radius, 0.05, 72);
    ring(mesh, T, m.length - 0.08, m.length + 0.06, m.neck_radius, 0.05, 72);
    for (const double a : {a0, a1}) ring(mesh, T, a - 0.03, a + 0.03, m.radius, 0.055, 96);

    mesh.material("white_panel");
    for (int k = 0; k < m.rows; ++k)
        shield_belt(mesh, T, {a0 + 0.02 + k * row, m.radius, a0 - 0.02 + (k + 1) * row, m.radius, m.panels_around},
                    random);
    shield_belt(
        mesh, T,
        {0.06, m.neck_radius + 0.06 * (m.radius - m.neck_radius) / a0, a0 - 0.03, m.radius - 0.03, m.panels_around},
        random);
    shield_belt(mesh, T,
                {a1 + 0.03, m.radius - 0.03, m.length - 0.06,
                 m.neck_radius + 0.06 * (m.radius - m.neck_radius) / a0, m.panels_around},
                random);

    const double span = 2 * kPi / m.panels_around;
    for (int k = 0; k < m.rows; ++k)
        for (int p = 0; p < m.panels_around; ++p) {
            const double pick = random.uniform(), a = a0 + (k + 0.5) * row;
            const Rigid3 here = on_side(T, a, m.radius + 0.035, (p + random.uniform(0.3, 0.7)) * span);
            if (pick < 0.22) {
                mesh.material("yellow");
                handrail(mesh, pick < 0.15 ? here : turned_about_z(here, kPi / 2), random.uniform(0.5, 0.8));
            } else if (pick < 0.36) {
                mesh.material(pick < 0.30 ? "aluminium" : "dark_grey");
                const Vec3 half{random.uniform(0.08, 0.28), random.uniform(0.08, 0.22), random.uniform(0.05, 0.14)};
                box(mesh, here * Rigid3{{}, {0, 0, half.z - 0.01}}, half, 0.012);
            }
        }
    mesh.material("yellow");
    for (int p = 0; p < m.panels_around; p += 2) {  // rails up the forward cone
        const double slope = std::atan2(m.radius - m.neck_radius, m.cone_length);
        const Rigid3 side =
            on_side(T, m.length - 0.5 * m.cone_length, 0.5 * (m.radius + m.neck_radius) + 0.03, (p + 0.5) * span);
        handrail(mesh, side * Rigid3{exp_rotation({0, slope, 0}), {}}, 0.55);
    }
}

double quilt(double s_m, double t_m, std::uint64_t seed) {
    const double pitch = 0.64, a = std::sin(kPi * (s_m + t_m) / pitch), b = std::sin(kPi * (s_m - t_m) / pitch);
    return 0.018 * std::abs(a * b) + 0.012 * fractal_noise(s_m / 0.5, t_m / 0.5, seed);
}

void blanket_can(Mesh& mesh, const Rigid3& T, double length, double radius, const std::string& blanket,
                 std::uint64_t seed) {
    const int segments = static_cast<int>(radius * 46);
    const double shoulder = 0.35 * radius;
    mesh.material(blanket);
    lathe(mesh, T,
          refined({{0, 0},
                   {0, 0.75 * radius},
                   {shoulder, radius},
                   {length - shoulder, radius},
                   {length, 0.75 * radius},
                   {length, 0}},
                  0.14),
          segments, kBlanketTile, [&](double angle, double a) {
              // Mirrored about the can's middle plane, so that it closes.
              return quilt(radius * std::abs(angle - kPi), a, seed);
          });
    mesh.material("aluminium");
    for (const double a : {0.02, shoulder, 0.5 * length, length - shoulder, length - 0.1})
        ring(mesh, T, a, a + 0.08, a < 0.1 || a > length - 0.2 ? 0.78 * radius : radius, 0.03, segments);
}

void solar_wing(Mesh& mesh, const Rigid3& T, double length, double blanket_width, int panels) {
    const double mast_m = 0.36, pitch = length / panels;
    mesh.material("aluminium");
    truss(mesh, T * Vec3{-0.8, 0, -0.1}, T * Vec3{length, 0, -0.1}, T.q * Vec3{0, 0, 1}, mast_m, panels, 0.022);
    lathe(mesh, T * Rigid3{{}, {-0.9, 0, -0.1}}, {{0, 0}, {0, 0.36}, {0.5, 0.36}, {0.6, 0.25}, {0.6, 0}}, 24);
    for (const double end : {0.0, length})
        box(mesh, T * Rigid3{{}, {end, 0, 0}}, {0.09, blanket_width + 0.34, 0.06}, 0.02);
    for (const int side : {-1, 1}) {
        const double y0 = side > 0 ? 0.3 : -0.3 - blanket_width;
        for (int k = 0; k < panels; ++k) {
            // Folded like an accordion: every second panel leans the other way.
            const double lean = k % 2 ? 0.035 : -0.035, tilt = 0.010 * std::sin(1.7 * k + side);
            const auto shape = [&](double u, double v, double w) {
                const double x = (k + 0.01 + 0.98 * u) * pitch;
                return T *
                       Vec3{x, y0 + v * blanket_width, lean * (u - 0.5) * 2 + tilt * (v - 0.5) + 0.02 * (w - 0.5)};
            };
            const double shift = 0.25 * k;
            mesh.material("solar_cell");
            plate(mesh, {1, 1, 0.01, 0.005, shape,
                         [&](double u, double v) {
                             return Uv{v * blanket_width / kCellTile,
                                       (u * std::round(pitch / 0.25) * 0.25) / kCellTile + shift};
                         },
                         "tan_film"});
        }
        mesh.material("tan_film");  // the edge strips that carry the cables
        for (const double y : {y0 - 0.02, y0 + blanket_width + 0.02})
            box(mesh, T * Rigid3{{}, {0.5 * length, y, -0.012}}, {0.5 * length, 0.02, 0.012}, 0.004);
    }
}

void radiator(Mesh& mesh, const Rigid3& T, double length, double width, int panels) {
    const double pitch = length / panels;
    for (int k = 0; k < panels; ++k) {
        const double lean = k % 2 ? 0.06 : -0.06;
        const auto point = [&](double x, double y, double z) {
            return T * Vec3{(k + 0.02 + 0.96 * x) * pitch, (y - 0.5) * width, lean * (x - 0.5) * 2 + z};
        };
        mesh.material("radiator");
        plate(mesh, {16,
                     2,
                     0.01,
                     0.01,
                     [&](double u, double v, double w) {
                         const double flute = w == 1 && std::lround(u * 16) % 2 == 1 ? 0.006 : 0.0;
                         return point(u, v, 0.05 * (w - 0.5) + flute);
                     },
                     [&](double u, double v) {
                         return Uv{u * pitch / kMetresPerTile, v * width / kMetresPerTile};
                     },
                     {}});
        mesh.material("aluminium");
        for (int line = 0; line < 6; ++line) {
            const double x = 0.08 + 0.168 * line;
            tube(mesh, point(x, 0.03, 0.028), point(x, 0.97, 0.028), 0.012, 6);
        }
        for (const double y : {0.0, 1.0}) tube(mesh, point(0.0, y, 0), point(1.0, y, 0), 0.03, 8);
    }
    tube(mesh, T * Vec3{-0.7, 0, -0.08}, T * Vec3{length, 0, -0.08}, 0.05, 10);
}

void robot_arm(Mesh& mesh, const std::vector<Vec3>& joints, double radius) {
    for (std::size_t k = 0; k < joints.size(); ++k) {
        mesh.material("dark_grey");
        ball(mesh, joints[k], 1.45 * radius, 20);
        if (k + 1 == joints.size()) break;
        const Rigid3 T = frame_along(joints[k], joints[k + 1] - joints[k]);
        const double length = norm(joints[k + 1] - joints[k]);
        mesh.material("white_film");
        tube(mesh, joints[k], joints[k + 1], radius, 20);
        mesh.material("aluminium");
        for (int band = 1; band < 6; ++band)
            ring(mesh, T, length * band / 6 - 0.04, length * band / 6 + 0.04, radius, 0.02, 20);
    }
    const Vec3 hand = joints.back(), along = normalized(hand - joints[joints.size() - 2]);
    mesh.material("aluminium");
    lathe(mesh, frame_along(hand, along),
          {{0, 0}, {0, 0.9 * radius}, {0.35, 0.9 * radius}, {0.45, 1.3 * radius}, {0.5, 1.3 * radius}, {0.5, 0}},
          20);
}

void nozzle(Mesh& mesh, const Rigid3& T, double exit_radius) {
    std::vector<ProfilePoint> profile;
    const auto bell = [&](int i) { return exit_radius * (0.3 + 0.7 * std::sqrt(i / 10.0)); };
    const double length = 1.6 * exit_radius, wall = 0.015;
    profile.push_back({-0.2, 0});
    profile.push_back({-0.2, bell(0) + wall});
    for (int i = 0; i <= 10; i += 2) profile.push_back({length * i / 10, bell(i) + wall});
    for (int i = 10; i >= 0; i -= 2) profile.push_back({length * i / 10, bell(i)});
    profile.push_back({0, 0});
    mesh.material("dark_grey");
    lathe(mesh, T, profile, exit_radius < 0.2 ? 14 : 36);
}

}  // namespace narpa::scenes
