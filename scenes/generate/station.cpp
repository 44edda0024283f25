#include "scenes/generate/scenes.h"

#include "scenes/generate/modules.h"

namespace narpa::scenes {
namespace {

constexpr Vec3 kForward{1, 0, 0}, kUp{0, 0, 1}, kRight{0, 1, 0};
constexpr double kTrussX = -10.5, kTrussZ = 3.1;

void pressurised_modules(Mesh& mesh) {
    Random random(2024);
    mesh.begin("node", "grey_hull");
    module(mesh, frame_along({-8.6, 0, 0}, kForward), {6.2, 2.1, 4, 12, 1.35, 0.62}, random);
    mesh.begin("laboratory", "grey_hull");
    module(mesh, frame_along({-17.2, 0, 0}, kForward), {8.5, 2.2, 6, 12, 1.35, 0.7}, random);
    mesh.begin("side_module", "grey_hull");
    module(mesh, frame_along({-5.5, -1.9, 0}, -kRight), {5.2, 1.55, 3, 9, 0.95, 0.55}, random);
    mesh.begin("airlock", "gold_blanket");
    blanket_can(mesh, frame_along({-5.5, 1.9, 0}, kRight), 3.1, 1.25, "gold_blanket", 31);
    mesh.begin("service_module", "grey_blanket");
    blanket_can(mesh, frame_along({-23.6, 0, 0}, kForward), 6.3, 1.75, "grey_blanket", 32);
    nozzle(mesh, frame_along({-23.6, 0.7, 0}, -kForward), 0.45);
    nozzle(mesh, frame_along({-23.6, -0.7, 0}, -kForward), 0.45);
}

/// A cargo ship hangs under the node.
void cargo_ship(Mesh& mesh) {
    mesh.begin("cargo_ship", "gold_blanket");
    blanket_can(mesh, frame_along({-5.5, 0, -2.0}, -kUp), 4.2, 1.1, "gold_blanket", 33);
    for (const int side : {-1, 1})
        solar_wing(
            mesh,
            {quat_from_columns(static_cast<double>(side) * kRight, static_cast<double>(side) * kUp, kForward),
             {-5.5, side * 2.0, -4.6}},
            3.5, 0.75, 7);
    nozzle(mesh, frame_along({-5.5, 0, -6.2}, -kUp), 0.35);
}

/// The cupola on top of the node, with its windows.
void cupola(Mesh& mesh) {
    const Rigid3 T = frame_along({-5.5, 0, 1.95}, kUp, kForward);
    mesh.begin("cupola", "white_panel");
    lathe(mesh, T, {{0, 0}, {0, 1.0}, {0.5, 1.0}, {1.1, 0.55}, {1.1, 0}}, 48);
    for (int k = 0; k < 6; ++k) {
        const double angle = k * kPi / 3;
        const Vec3 out{0, std::cos(angle), std::sin(angle)}, along{0.6, -0.45 * out.y, -0.45 * out.z};
        const Rigid3 pane = T * frame_along(Vec3{0.8, 0.775 * out.y, 0.775 * out.z}, along, out);
        mesh.material("aluminium");
        box(mesh, pane, {0.29, 0.27, 0.03}, 0.01);
        mesh.material("glass");
        box(mesh, pane * Rigid3{{}, {0, 0, 0.02}}, {0.23, 0.21, 0.02}, 0.008);
    }
    mesh.material("glass");
    lathe(mesh, T, {{1.05, 0}, {1.05, 0.4}, {1.13, 0.4}, {1.13, 0}}, 48);
}

/// The main truss across, four wings at its ends, radiators between.
void truss_and_wings(Mesh& mesh) {
    mesh.begin("truss", "aluminium");
    truss(mesh, {kTrussX, -12.2, kTrussZ}, {kTrussX, 12.2, kTrussZ}, kUp, 1.1, 22, 0.05);
    for (const double y : {-1.5, 1.5})
        for (const double x : {-0.5, 0.5})
            tube(mesh, {kTrussX + 2 * x, 0.7 * y, 1.85}, {kTrussX + x, y, kTrussZ - 0.5}, 0.07, 12);
    Random random(7);
    for (int k = 0; k < 16; ++k) {  // avionics boxes inside the truss
        mesh.material(k % 3 == 0 ? "gold_blanket" : k % 3 == 1 ? "white_film" : "dark_grey");
        const double y = -8.4 + 1.1 * k;
        box(mesh, {{}, {kTrussX + random.uniform(-0.1, 0.2), y, kTrussZ + random.uniform(-0.15, 0.15)}},
            {random.uniform(0.2, 0.36), random.uniform(0.2, 0.42), random.uniform(0.2, 0.36)}, 0.03);
    }
    for (const int side : {-1, 1}) {
        mesh.begin(side > 0 ? "wing_hub_right" : "wing_hub_left", "aluminium");
        lathe(mesh, frame_along({kTrussX, side * 11.2, kTrussZ}, kRight),
              {{-0.5, 0}, {-0.5, 0.75}, {-0.4, 0.85}, {0.4, 0.85}, {0.5, 0.75}, {0.5, 0}}, 48);
        for (const int up : {-1, 1}) {
            mesh.begin(std::string("wing_") + (side > 0 ? "right_" : "left_") + (up > 0 ? "up" : "down"),
                       "solar_cell");
            const double turn = 0.42 + 0.10 * side * up;  // towards the Sun, each at its own angle
            const Vec3 x = up * kUp, z{std::cos(turn), std::sin(turn), 0};
            solar_wing(mesh, {quat_from_columns(x, cross(z, x), z), {kTrussX, side * 11.2, kTrussZ + up * 1.6}},
                       9.4, 2.2, 19);
        }
        mesh.begin(side > 0 ? "radiator_right" : "radiator_left", "radiator");
        const double turn = -0.75 + 0.15 * side;
        const Vec3 z{std::cos(turn), std::sin(turn), 0};
        radiator(mesh, {quat_from_columns(kUp, cross(z, kUp), z), {kTrussX, side * 5.2, kTrussZ + 1.2}}, 6.6, 2.6,
                 5);
    }
}

void antennas_and_arm(Mesh& mesh) {
    mesh.begin("antennas", "white_film");
    mesh.material("aluminium");
    tube(mesh, {kTrussX, -2.2, kTrussZ + 0.5}, {kTrussX + 0.2, -2.2, kTrussZ + 2.4}, 0.05, 12);
    dish(mesh, frame_along({kTrussX + 0.4, -2.2, kTrussZ + 2.4}, {0.8, -0.45, 0.55}), 1.9, "white_film",
         "aluminium");
    mesh.material("aluminium");
    tube(mesh, {-6.6, 1.4, -1.5}, {-6.2, 2.5, -2.7}, 0.05, 12);
    dish(mesh, frame_along({-6.0, 2.6, -2.8}, {0.9, 0.3, -0.4}), 1.1, "white_film", "aluminium");
    mesh.material("aluminium");
    pipe(mesh, {{-4.4, -1.2, 1.7}, {-4.2, -1.5, 2.8}, {-3.6, -1.7, 3.3}}, 0.03);
    for (const double z : {-0.9, 1.1})  // rods for proximity radio on the forward cone
        pipe(mesh, {{-2.9, 1.75, z}, {-2.4, 2.05, 1.1 * z}, {-1.9, 2.1, 1.15 * z}}, 0.018);
    mesh.material("lamp");
    ball(mesh, {-3.6, -1.7, 3.32}, 0.05);
    mesh.begin("arm", "white_film");
    robot_arm(mesh, {{-4.6, 1.3, 1.75}, {-4.2, 1.7, 2.5}, {-6.8, 3.6, 5.9}, {-3.4, 4.8, 3.9}, {-3.0, 4.6, 3.2}},
              0.16);
}

}  // namespace

std::vector<MaterialSpec> scene_materials() {
    return {
        {"white_panel", {0.92, 0.92, 0.92}, {}, 1, "hull.png"},
        {"white_blanket", {0.90, 0.90, 0.88}, {}, 1, "blanket.png"},
        {"grey_blanket", {0.50, 0.50, 0.52}, {}, 1, "blanket.png"},
        {"gold_blanket", {0.66, 0.46, 0.16}, {0.16, 0.12, 0.06}, 9, "blanket.png"},
        {"grey_hull", {0.28, 0.28, 0.29}},
        {"white_film", {0.72, 0.72, 0.70}},
        {"aluminium", {0.36, 0.36, 0.37}, {0.40, 0.40, 0.41}, 24},
        {"dark_grey", {0.12, 0.12, 0.13}, {0.06, 0.06, 0.06}, 12},
        {"solar_cell", {1.0, 1.0, 1.0}, {0.0, 0.0, 0.0}, 1, "cells.png"},
        {"tan_film", {0.45, 0.34, 0.18}},
        {"radiator", {0.80, 0.80, 0.80}},
        {"yellow", {0.60, 0.46, 0.08}},
        {"glass", {0.02, 0.03, 0.04}, {0.30, 0.30, 0.30}, 300},
        {"rubber", {0.05, 0.05, 0.05}},
        {"hatch", {0.88, 0.88, 0.88}, {}, 1, "port.png"},
        {"ring_face", {0.55, 0.55, 0.56}, {0.20, 0.20, 0.20}, 18, "ring.png"},
        {"black", {0.03, 0.03, 0.03}},
        {"target_white", {0.70, 0.70, 0.70}, {}, 1, {}, {45, 45, 45}},  // edge-lit, so that it is seen in shadow
        {"lamp", {0.05, 0.05, 0.05}, {}, 1, {}, {250, 250, 240}},       // as bright in shadow as in sunlight
        {"post_lamp", {0.05, 0.05, 0.05}, {}, 1, {}, {320, 320, 307}},  // seen from farther away
    };
}

Mesh build_station() {
    Mesh mesh;
    add_docking_port(mesh);
    pressurised_modules(mesh);
    cupola(mesh);
    cargo_ship(mesh);
    truss_and_wings(mesh);
    antennas_and_arm(mesh);
    return mesh;
}

}  // namespace narpa::scenes
