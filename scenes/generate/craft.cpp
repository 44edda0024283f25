#include "scenes/generate/scenes.h"

#include "scenes/generate/noise.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

constexpr int kDishSegments = 96;  // smooth also where a dish fills the view

/// A wrinkled blanket over one side of the bus: a plate whose outer face T's z axis points to.
void blanket(Mesh& mesh, const Rigid3& T, double half_u, double half_v, int steps, std::uint64_t seed) {
    Plate p;
    p.nu = p.nv = steps;
    p.bevel_u = p.bevel_v = 0.01;
    p.shape = [=](double u, double v, double w) {
        const double fold =
            0.018 * fractal_noise(7 * u, 7 * v, seed) + 0.02 * std::sin(kPi * u) * std::sin(kPi * v);
        return T * Vec3{(2 * u - 1) * half_u, (2 * v - 1) * half_v, w * (0.03 + fold)};
    };
    p.uv = [](double u, double v) { return Uv{u, v}; };
    plate(mesh, p);
}

void bus(Mesh& mesh) {
    const Vec3 half{1.1, 0.9, 1.2};
    mesh.begin("bus", "grey");
    box(mesh, {}, half, 0.02);
    mesh.begin("blankets", "gold");
    for (int axis = 0; axis < 3; ++axis)
        for (const int s : {-1, 1}) {
            Vec3 out{}, along{};
            out[axis] = s;
            along[(axis + 1) % 3] = 1;
            const Vec3 up = cross(out, along);
            const Rigid3 T{quat_from_columns(along, up, out), half[axis] * out};
            const double u = half[(axis + 1) % 3] - 0.05, v = half[(axis + 2) % 3] - 0.05;
            blanket(mesh, T, u, v, 83, static_cast<std::uint64_t>(3 * axis + s + 1));
        }
}

/// One of the two wings: five panels of cells on a truss mast.
void wing(Mesh& mesh, int side) {
    const double s = side;
    mesh.begin(side > 0 ? "mast_left" : "mast_right", "metal");
    truss(mesh, {0, 0.9 * s, 0}, {0, 7.9 * s, 0}, {0, 0, 1}, 0.24, 40, 0.014);
    for (const double x : {-0.8, 0.8}) tube(mesh, {0, 1.0 * s, 0.1}, {x, 1.46 * s, 0.16}, 0.03, 12);  // yoke
    for (int k = 0; k < 5; ++k) {
        mesh.begin(side > 0 ? "panels_left" : "panels_right", "cell");
        Plate p;
        p.nu = 40, p.nv = 48;
        p.bevel_u = p.bevel_v = 0.005;
        const double y = 1.5 + 1.28 * k, x_axis = s;
        p.shape = [=](double u, double v, double w) {  // rows of cells stand out by a millimetre or two
            const double cell = 0.002 * std::abs(std::sin(kPi * 8 * u) * std::sin(kPi * 12 * v));
            return Vec3{(2 * v - 1) * -1.25 * x_axis, s * (y + 1.2 * u), 0.15 + w * (0.025 + cell)};
        };
        p.uv = [](double u, double v) { return Uv{u, v}; };
        p.underside = "white";
        plate(mesh, p);
        mesh.begin("hinges", "metal");
        for (const double x : {-0.8, 0.8}) box(mesh, {{}, {x, s * (y - 0.04), 0.16}}, {0.06, 0.06, 0.03}, 0.008);
    }
}

void antennas(Mesh& mesh) {
    mesh.begin("dishes", "white");
    dish(mesh, frame_along({1.3, 0.1, 1.75}, {0.75, -0.3, 0.6}), 1.8, "white", "metal", kDishSegments);
    dish(mesh, frame_along({-0.9, -0.4, 1.8}, {0.4, -0.5, 0.9}), 0.9, "white", "metal", kDishSegments);
    dish(mesh, frame_along({-0.5, 0.4, -1.7}, {0.5, -0.4, -0.8}), 1.1, "white", "metal", kDishSegments);
    mesh.begin("dish_masts", "metal");
    tube(mesh, {0.7, 0.1, 1.1}, {1.15, 0.15, 1.65}, 0.06, 16);
    tube(mesh, {-0.9, -0.4, 1.1}, {-0.95, -0.38, 1.7}, 0.04, 16);
    tube(mesh, {-0.5, 0.4, -1.1}, {-0.55, 0.42, -1.6}, 0.04, 16);
    mesh.begin("rods", "metal");
    for (int k = 0; k < 16; ++k) {
        const double angle = 2 * kPi * k / 16, r = 0.75;
        const Vec3 foot{-1.1, r * std::cos(angle), r * std::sin(angle)};
        tube(mesh, foot, foot + Vec3{-1.4 - 0.05 * (k % 3), 0.5 * std::cos(angle), 0.5 * std::sin(angle)}, 0.012,
             10);
    }
    truss(mesh, {-0.2, 0, 1.2}, {-1.4, 0.3, 4.2}, {0, 1, 0}, 0.2, 16, 0.012);
    mesh.begin("probe", "grey");
    ball(mesh, {-1.4, 0.3, 4.3}, 0.18, 60);
}

void docking_ring(Mesh& mesh) {
    mesh.begin("ring", "metal");
    const double x = 1.2;
    lathe(mesh, {},
          {{x, 0.55}, {x, 0.68}, {x + 0.22, 0.68}, {x + 0.25, 0.65}, {x + 0.25, 0.58}, {x + 0.22, 0.55}, {x, 0.55}},
          160);
    mesh.begin("petals", "grey");
    for (int k = 0; k < 3; ++k) {
        const Rigid3 T{exp_rotation({2 * kPi * k / 3, 0, 0}), {}};
        box(mesh, T * Rigid3{exp_rotation({0, 0.3, 0}), {x + 0.33, 0, 0.57}}, {0.14, 0.16, 0.015}, 0.004);
    }
    mesh.begin("thrusters", "grey");
    for (const int sy : {-1, 1})
        for (const int sz : {-1, 1})
            lathe(mesh, frame_along({1.05, 0.95 * sy, 1.05 * sz}, {0.2, 1.0 * sy, 1.0 * sz}),
                  {{0, 0}, {0, 0.06}, {0.05, 0.03}, {0.2, 0.09}, {0.2, 0.08}, {0.05, 0.02}, {0.05, 0}}, 40);
}

}  // namespace

std::vector<MaterialSpec> craft_materials() {
    return {{"gold", {0.55, 0.40, 0.14}, {0.30, 0.25, 0.12}, 30},
            {"white", {0.80, 0.80, 0.78}},
            {"grey", {0.35, 0.35, 0.36}},
            {"metal", {0.45, 0.45, 0.47}},
            {"cell", {0.06, 0.07, 0.16}}};
}

Mesh build_craft() {
    Mesh mesh;
    bus(mesh);
    for (const int side : {-1, 1}) wing(mesh, side);
    antennas(mesh);
    docking_ring(mesh);
    return mesh;
}

}  // namespace narpa::scenes
