#include "scenes/generate/modules.h"
#include "scenes/generate/scenes.h"
#include "scenes/generate/textures.h"

namespace narpa::scenes {
namespace {

constexpr double kPortHatchX = -0.45;  ///< of the hatch, behind the interface plane
constexpr double kStandOffX = -0.15;   ///< plane of the target's raised cross
constexpr double kHullRadius = 0.92;   ///< of the port's forward rim

/// Point on a circle about the port's axis.
Vec3 polar(double x, double r, double angle) {
    return {x, r * std::cos(angle), r * std::sin(angle)};
}
/// Frame on that circle: x along the port's axis, z outwards.
Rigid3 polar_frame(double x, double r, double angle) {
    return {exp_rotation({angle - kPi / 2, 0, 0}), polar(x, r, angle)};
}

/// The tapered adapter in quilted insulation that ends in the open tunnel.
void adapter(Mesh& mesh) {
    mesh.begin("port_adapter", "white_blanket");
    lathe(mesh, {},
          refined({{-2.6, 0}, {-2.6, 1.32}, {-2.25, 1.32}, {-0.80, kHullRadius}, {-0.48, kHullRadius}, {-0.48, 0}},
                  0.08),
          120, kBlanketTile, [](double angle, double a) {
              return a > -2.26 && a < -0.49 ? quilt(1.1 * std::abs(angle - kPi), a, 11) : 0.0;
          });
    mesh.material("aluminium");
    // Forward bulkhead and tunnel wall: a ring with the hatch's seat inside.
    lathe(mesh, {},
          {{-0.5, 0},
           {-0.5, 0.97},
           {-0.16, 0.97},
           {-0.12, 0.93},
           {-0.12, 0.66},
           {kPortHatchX, 0.63},
           {kPortHatchX, 0}},
          128);
    mesh.material("dark_grey");
    for (const double a : {-2.3, -1.55, -0.85})
        lathe(mesh, {},
              {{a, 0.8},
               {a, 1.34 - 0.29 * (a + 2.25)},
               {a + 0.05, 1.34 - 0.29 * (a + 2.3)},
               {a + 0.05, 0.8},
               {a, 0.8}},
              96);
    mesh.material("yellow");
    for (int k = 0; k < 8; ++k) {
        const double angle = kPi / 8 + k * kPi / 4;
        const Vec3 p = polar(-1.45, 1.16, angle), along = polar(-1.0, 1.02, angle) - p;
        handrail(mesh, frame_along(p, along, polar(0, 1, angle)), 0.7);
    }
    mesh.material("dark_grey");
    for (int k = 0; k < 3; ++k) {  // cable runs down the taper
        const double angle = 0.35 + k * 2.1;
        pipe(mesh,
             {polar(-2.3, 1.40, angle), polar(-1.6, 1.23, angle + 0.08), polar(-0.9, 1.03, angle + 0.03),
              polar(-0.5, 1.0, angle)},
             0.025);
    }
}

/// Soft-capture ring, hard-capture flange with its hooks, and the seals.
void rings(Mesh& mesh) {
    mesh.begin("port_ring", "ring_face");
    const double face = -0.012;  // contact pads and bolt heads fill the rest up to the interface plane
    lathe_facing(mesh, {},
                 {{-0.14, kRingInner},
                  {-0.14, kRingOuter - 0.02},
                  {-0.05, kRingOuter},
                  {face - 0.008, kRingOuter},
                  {face, kRingOuter - 0.008},
                  {face, kRingInner + 0.008},
                  {face - 0.008, kRingInner},
                  {-0.14, kRingInner}},
                 144, kRingTile);
    lathe_facing(mesh, {}, {{-0.2, 0.80}, {-0.2, 0.95}, {-0.03, 0.95}, {-0.02, 0.94}, {-0.02, 0.80}, {-0.2, 0.80}},
                 144, kRingTile);
    for (int k = 0; k < 24; ++k) {
        const double angle = (k + 0.5) * kPi / 12;
        mesh.material("aluminium");
        lathe(mesh, {{}, polar(face, 0.715, angle)}, {{-0.005, 0}, {-0.005, 0.009}, {0.008, 0.009}, {0.008, 0}}, 6);
        if (k % 4 != 0) continue;
        mesh.material("dark_grey");
        box(mesh, polar_frame(face, 0.66, angle), {0.012, 0.06, 0.02}, 0.003);
    }
    mesh.material("rubber");
    for (const double r : {0.825, 0.865})
        lathe(
            mesh, {},
            {{-0.03, r - 0.012}, {-0.03, r + 0.012}, {-0.012, r + 0.007}, {-0.012, r - 0.007}, {-0.03, r - 0.012}},
            128);
    for (int k = 0; k < 12; ++k) {
        const double angle = (k + 0.5) * kPi / 6;
        mesh.material("dark_grey");
        box(mesh, polar_frame(-0.03, 0.91, angle), {0.014, 0.055, 0.022}, 0.004);
        mesh.material("aluminium");
        tube(mesh, polar(-0.03, 0.91, angle + 0.10), polar(-0.012, 0.91, angle + 0.10), 0.014, 12);
    }
    mesh.material("aluminium");
    for (int k = 0; k < 6; ++k) {  // the ring's struts, in three pairs
        const double angle = (k / 2) * 2 * kPi / 3 + (k % 2 ? 0.42 : -0.42) + kPi / 3;
        tube(mesh, polar(-0.13, 0.68, angle), polar(-0.42, 0.615, angle + (k % 2 ? 0.25 : -0.25)), 0.018, 10);
    }
}

/// Three guide petals that lean inwards, and the capture latches between them. Nothing else is before x = 0.
void petals_and_latches(Mesh& mesh) {
    mesh.begin("port_petals", "aluminium");
    for (int k = 0; k < 3; ++k) {
        const double middle = kPi / 2 + k * 2 * kPi / 3;
        plate(mesh, {14,
                     8,
                     0.03,
                     0.05,
                     [&](double u, double v, double w) {
                         const double half = 0.50 - 0.26 * v * v;  // narrower towards the tip, radians
                         const double x = -0.10 + 0.30 * v;
                         const double r = 0.588 - 0.10 * std::max(0.0, v - 0.33) - 0.03 * v * v - 0.018 * (1 - w);
                         return polar(x, r, middle + (2 * u - 1) * half);
                     },
                     [&](double u, double v) {
                         return Uv{u, v};
                     },
                     {}});
        mesh.material("dark_grey");  // a stiffener and a sensor on the petal's back, inside the free opening
        box(mesh, polar_frame(-0.06, 0.575, middle + 0.4), {0.035, 0.03, 0.022}, 0.005);
        const double between = middle + kPi / 3;
        mesh.material("dark_grey");
        box(mesh, polar_frame(-0.05, 0.765, between), {0.04, 0.07, 0.03}, 0.006);
        mesh.material("yellow");
        box(mesh, polar_frame(-0.012, 0.765, between), {0.01, 0.022, 0.018}, 0.003);
        mesh.material("rubber");
        tube(mesh, polar(-0.06, 0.765, between + 0.16), polar(-0.006, 0.765, between + 0.16), 0.02, 12);
        mesh.material("aluminium");
    }
}

/// Hatch with its window pane of markings, and the docking target: a plate with a white cross, and the same cross
/// on a stand-off before it. Seen along the axis the two coincide; off the axis the parallax shows.
void hatch_and_target(Mesh& mesh) {
    mesh.begin("port_hatch", "hatch");
    const double front = kPortHatchX + 0.03;
    lathe_facing(mesh, {},
                 {{kPortHatchX - 0.02, 0},
                  {kPortHatchX - 0.02, 0.60},
                  {front - 0.02, 0.60},
                  {front, 0.58},
                  {front, 0.475},
                  {front + 0.012, 0.465},
                  {front + 0.012, 0.435},
                  {front, 0.425},
                  {front, 0.22},
                  {front, 0}},
                 128, kHatchTile);
    mesh.material("aluminium");
    for (int k = 0; k < 8; ++k) {  // ribs between the inner and the outer circle
        const double angle = kPi / 8 + k * kPi / 4;
        box(mesh, polar_frame(front, 0.36, angle), {0.012, 0.012, 0.055}, 0.004);
    }
    for (int k = 0; k < 16; ++k)  // latches around the rim
        box(mesh, polar_frame(front, 0.525, (k + 0.5) * kPi / 8), {0.02, 0.028, 0.024}, 0.005);
    pipe(mesh,
         {polar(front, 0.30, 2.9), polar(front + 0.06, 0.30, 2.9), polar(front + 0.06, 0.30, 3.38),
          polar(front, 0.30, 3.38)},
         0.012);  // its handle
    mesh.begin("port_target", "black");
    box(mesh, {{}, {front, 0, 0}}, {0.012, 0.19, 0.19}, 0.004);
    const double plate_front = front + 0.012;
    mesh.material("target_white");
    for (const bool upright : {true, false})
        box(mesh, {{}, {plate_front, 0, 0}}, upright ? Vec3{0.004, 0.016, 0.165} : Vec3{0.003, 0.165, 0.016},
            0.001);
    for (int k = 0; k < 4; ++k)
        lathe(mesh, {{}, polar(plate_front - 0.002, 0.165, kPi / 4 + k * kPi / 2)},
              {{0, 0}, {0, 0.014}, {0.006, 0.014}, {0.006, 0}}, 24);
    mesh.material("black");
    tube(mesh, {plate_front, 0, 0}, {kStandOffX - 0.006, 0, 0}, 0.010, 16);
    mesh.material("target_white");
    for (const bool upright : {true, false})
        box(mesh, {{}, {kStandOffX, 0, 0}}, upright ? Vec3{0.006, 0.010, 0.075} : Vec3{0.005, 0.075, 0.010}, 0.001);
}

/// A lamp whose bright disc of this radius faces the chaser, on a wide black housing: from every side its centre is
/// the optical centre, and nothing bright is seen beside it.
void lamp(Mesh& mesh, const char* material, const Vec3& optical_centre, double radius, double depth) {
    constexpr double kDisc = 0.0005, kHousing = 1.8;
    mesh.material("black");
    lathe(mesh, {{}, optical_centre},
          {{-depth, 0}, {-depth, kHousing * radius}, {-kDisc, kHousing * radius}, {-kDisc, 0}}, 24);
    mesh.material(material);
    lathe(mesh, {{}, optical_centre}, {{-kDisc, 0}, {-kDisc, radius}, {0, radius}, {0, 0}}, 24);
}

/// The marks that a camera navigates by: small lamps on the hatch for the last metres, large ones on posts around
/// the port, in three planes, for the approach. The scenes state their optical centres.
void lights(Mesh& mesh) {
    mesh.begin("port_lights", "dark_grey");
    for (int k = 0; k < 8; ++k)  // four near the target, four on the hatch's ring
        lamp(mesh, "lamp", k % 2 ? polar(-0.404, 0.452, k * kPi / 4) : polar(-0.412, 0.245, k * kPi / 4), 0.012,
             0.02);
    struct Post {
        double x, angle_deg;
    };
    for (const auto& [x, angle_deg] : {Post{-0.10, 36}, Post{-0.40, 104}, Post{-0.10, 150}, Post{-0.40, 216},
                                       Post{-0.10, 262}, Post{-0.25, 322}}) {
        const double angle = angle_deg * kPi / 180;
        mesh.material("aluminium");
        tube(mesh, polar(-0.55, 0.95, angle), polar(x - 0.03, 1.12, angle), 0.02, 10);
        lamp(mesh, "post_lamp", polar(x, 1.12, angle), 0.035, 0.05);
    }
}

/// Around the port on the bulkhead: umbilical connectors, and corner-cube reflectors for a LiDAR to
/// range on.
void fittings(Mesh& mesh) {
    mesh.begin("port_fittings", "dark_grey");
    for (int k = 0; k < 6; ++k) {
        const double angle = 0.26 + k * kPi / 3;
        mesh.material("white_film");
        box(mesh, polar_frame(-0.33, 1.03, angle), {0.10, 0.09, 0.07}, 0.012);
        mesh.material("dark_grey");
        for (const double side : {-0.04, 0.04})
            tube(mesh, polar(-0.24, 1.03, angle + side), polar(-0.19, 1.03, angle + side), 0.028, 14);
    }
    for (int k = 0; k < 3; ++k) {
        const double angle = 0.9 + k * 2 * kPi / 3;
        mesh.material("aluminium");
        tube(mesh, polar(-0.5, 0.96, angle), polar(-0.30, 1.10, angle), 0.02, 10);
        lathe(mesh, {{}, polar(-0.30, 1.10, angle)}, {{-0.03, 0}, {-0.03, 0.07}, {0.02, 0.07}, {0.02, 0}}, 6);
        mesh.material("glass");
        lathe(mesh, {{}, polar(-0.28, 1.10, angle)}, {{-0.01, 0}, {-0.01, 0.05}, {0.006, 0.05}, {0.006, 0}}, 24);
    }
}

}  // namespace

void add_docking_port(Mesh& mesh) {
    fittings(mesh);
    adapter(mesh);
    rings(mesh);
    petals_and_latches(mesh);
    hatch_and_target(mesh);
    lights(mesh);
}

}  // namespace narpa::scenes
