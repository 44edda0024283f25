#include "scenes/generate/scenes.h"

#include "scenes/generate/modules.h"
#include "scenes/generate/textures.h"

namespace narpa::scenes {
namespace {

constexpr double kTunnelRadius = 0.63, kHatchX = -0.5, kNoseX = -2.6, kBodyRadius = 1.9, kTrunkX = -5.6;

/// Nose cone with the open tunnel, capsule and trunk: one closed hull.
void hull(Mesh& mesh) {
    mesh.begin("chaser_hull", "white_film");
    lathe(mesh, {},
          {{kTrunkX, 0},
           {kTrunkX, kBodyRadius},
           {kNoseX, kBodyRadius},
           {-0.22, 0.80},
           {-0.10, 0.80},
           {-0.10, 0.70},
           {-0.03, 0.70},
           {-0.03, kTunnelRadius + 0.02},
           {kHatchX, kTunnelRadius},
           {kHatchX, 0}},
          96);
    Random random(4);
    mesh.material("white_panel");
    shield_belt(mesh, {}, {kNoseX - 1.1, kBodyRadius, kNoseX - 0.05, kBodyRadius, 10}, random);
    mesh.material("dark_grey");
    for (const double a : {kTrunkX, kNoseX - 1.25})
        lathe(mesh, {}, {{a, 1.8}, {a, 1.95}, {a + 0.1, 1.95}, {a + 0.1, 1.8}, {a, 1.8}}, 96);
    nozzle(mesh, frame_along({kTrunkX, 0, 0}, {-1, 0, 0}), 0.5);
}

/// Passive docking ring: it has no petals of its own and takes the station's inside its tunnel.
void ring(Mesh& mesh) {
    mesh.begin("chaser_ring", "aluminium");
    lathe(mesh, {},
          {{-0.12, kTunnelRadius},
           {-0.12, 0.74},
           {-0.006, 0.74},
           {0, 0.734},
           {0, kTunnelRadius + 0.006},
           {-0.006, kTunnelRadius},
           {-0.12, kTunnelRadius}},
          120);
}

/// The camera's box in the hatch (its lens is at x = -0.45) and the LiDAR's mast.
void sensors(Mesh& mesh) {
    mesh.begin("chaser_sensors", "dark_grey");
    box(mesh, {{}, {-0.49, 0, 0}}, {0.02, 0.05, 0.05}, 0.005);
    tube(mesh, {-2.0, 0, 1.5}, {-1.9, 0, 2.02}, 0.05, 12);
    lathe(mesh, frame_along({-1.9, 0, 2.0}, {0, 0, 1}), {{0, 0}, {0, 0.06}, {0.04, 0.06}, {0.04, 0}}, 24);
    mesh.begin("chaser_thrusters", "dark_grey");
    for (int k = 0; k < 4; ++k) {
        const double angle = kPi / 4 + k * kPi / 2;
        const Rigid3 side{exp_rotation({angle - kPi / 2, 0, 0}),
                          {-3.9, 1.92 * std::cos(angle), 1.92 * std::sin(angle)}};
        box(mesh, side, {0.25, 0.18, 0.10}, 0.02);
        nozzle(mesh, side * frame_along({0.25, 0, 0.04}, {1, 0, 0.3}), 0.06);
        nozzle(mesh, side * frame_along({-0.25, 0, 0.04}, {-1, 0, 0.3}), 0.06);
    }
}

void wings(Mesh& mesh) {
    for (const int side : {-1, 1}) {
        mesh.begin(side > 0 ? "chaser_wing_left" : "chaser_wing_right", "solar_cell");
        const double s = side;
        solar_wing(mesh, {quat_from_columns({0, s, 0}, {0, 0, s}, {1, 0, 0}), {-4.9, 2.7 * s, 0}}, 3.6, 0.9, 4);
    }
}

}  // namespace

Mesh build_chaser() {
    Mesh mesh;
    hull(mesh);
    ring(mesh);
    sensors(mesh);
    wings(mesh);
    return mesh;
}

}  // namespace narpa::scenes
