/// scenes/generate/scenes.h - the meshes and tables of the generated scenes. Metres; triangles face outwards.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

// --- Docking: axes of both ships have their origin at the centre of the docking interface plane, x out of the
// port, z up ---

/// Radius of the free opening of the docking ring, and the ring's outer radius, metres: both ships have them.
inline constexpr double kRingInner = 0.60, kRingOuter = 0.74;

std::vector<MaterialSpec> scene_materials();
/// About 29 m across.
Mesh build_station();
/// The port alone: ring, guide petals, latches, hatch, target. Its hull reaches back to x = -2.5.
void add_docking_port(Mesh& mesh);
/// The visiting ship. Its nose is an open tunnel, and the camera is in its hatch.
Mesh build_chaser();

inline constexpr double kApproachDuration_s = 60, kApproachStep_s = 0.1;
/// The chaser in the station's frame at a time in [0, 60] s: twice continuously differentiable, velocity and rate
/// its exact derivatives. Contact (the pose of the port itself, rotated by half a turn about z) at 60 s.
Motion approach_at(double t_s);
/// Writes the table. Throws std::runtime_error where it cannot.
void write_approach(const std::string& path);

// --- Craft: 200,000 triangles to measure speed on. A bus in wrinkled blankets between two long solar wings,
// trusses, dishes, antenna rods and a docking ring. Origin in the bus, wings along y, docking ring towards x, z up;
// 16 m from tip to tip ---

/// Without textures.
std::vector<MaterialSpec> craft_materials();
Mesh build_craft();

// --- Descent: cratered ground. Hills of a few tens of metres, craters of 3 to 40 m, one metre between vertices.
// Origin in the centre, z up ---

/// Extent along x and along y; ground.png covers it once.
inline constexpr double kTerrainSide = 360;
/// An open sheet, facing up.
Mesh build_terrain();

// --- Small body: a triaxial ellipsoid of 56 x 40 x 34 m with craters of 1 to 18 m and boulders of half a metre to
// 3 m. Origin in the centre, longest axis x, spin axis z ---

/// Closed; about 0.4 m between vertices.
Mesh build_small_body();

// --- Tag board: four square tags and five reflectors on a board of 0.92 m that faces x, z up ---

std::vector<MaterialSpec> tag_board_materials();
Mesh build_tag_board();

// --- Landing site: cratered ground with rocks about a clear place, a few hundredths of the distance from it
// between vertices. Origin on the ground at the site, z up. And a lander with four feet: origin in its middle, z up
// ---

/// Of the ground from the site.
inline constexpr double kLandingReach_m = 2500;
/// The lander's feet, in its z and from that axis.
inline constexpr double kLanderFeet_m = -1.3, kLanderFeetRadius_m = 1.6;
std::vector<MaterialSpec> lander_materials();
/// An open sheet, facing up.
Mesh build_landing_site();
/// The same ground as a map from orbit has it: posts half a metre apart at best, no bump below two metres, heights
/// off by some centimetres.
Mesh build_landing_map();
Mesh build_lander();

// --- Debris: what is left of a satellite, 40 minutes after it broke up. A cloud of small pieces, 70 m along x,
// that expands from its middle while they tumble ---

enum class DebrisKind : std::uint8_t { panel, rod, block, flake };
struct DebrisName {
    DebrisKind kind;
    const char* name;  ///< of its mesh; the pieces are `name`-NUMBER
};
inline constexpr std::array<DebrisName, 4> kDebrisNames{{{DebrisKind::panel, "panel"},
                                                         {DebrisKind::rod, "rod"},
                                                         {DebrisKind::block, "block"},
                                                         {DebrisKind::flake, "flake"}}};
inline constexpr int kDebrisPieces = 10000;
std::vector<MaterialSpec> debris_materials();
/// Some tens of triangles, up to 1.2 m long.
Mesh build_debris(DebrisKind kind);
/// Writes the table of the pieces' motions. Throws std::runtime_error where it cannot.
void write_debris(const std::string& path);

// --- Terrain: an elevation model of cratered ground, 4.1 km square, hills of a hundred metres and craters of 8 to
// 500 m, as a 16-bit PNG ---

inline constexpr int kHighlandPosts = 1025;
inline constexpr double kHighlandSpacing_m = 4;
/// Height = number * step - zero.
inline constexpr double kHighlandStep_m = 0.01, kHighlandZero_m = 300;
/// Throws std::runtime_error where it cannot.
void write_highland(const std::string& path);

}  // namespace narpa::scenes
