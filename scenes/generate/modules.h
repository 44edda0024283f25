/// scenes/generate/modules.h - the larger pieces of a spaceship. Metres; each leaves the mesh's part as it set it.
#pragma once

#include <string>

#include "scenes/generate/noise.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {

/// A belt of shield panels on a cone or cylinder about T's x axis: from (a0, r0) to (a1, r1), `count` around.
struct ShieldBelt {
    double a0, r0, a1, r1;
    int count;
};
void shield_belt(Mesh& mesh, const Rigid3& T, const ShieldBelt& belt, Random& random);

/// A pressurised module along T's x axis: hull, end cones, frames, shield panels, handrails, boxes.
struct Module {
    double length = 5, radius = 2.1;
    int rows = 4, panels_around = 12;
    double neck_radius = 1.3, cone_length = 0.6;  ///< of the cones at both ends, inside the length
};
void module(Mesh& mesh, const Rigid3& T, const Module& m, Random& random);

/// A can in quilted insulation along T's x axis, with end rings.
void blanket_can(Mesh& mesh, const Rigid3& T, double length, double radius, const std::string& blanket,
                 std::uint64_t seed);
/// Height of quilted insulation at a place on its surface, metres.
double quilt(double s_m, double t_m, std::uint64_t seed);

/// Solar wing: a mast along T's x axis with a blanket of panels on each side (along y), cells towards +z.
void solar_wing(Mesh& mesh, const Rigid3& T, double length, double blanket_width, int panels);
/// Radiator of folding panels along T's x axis, `width` along y, radiating to +z and -z.
void radiator(Mesh& mesh, const Rigid3& T, double length, double width, int panels);
/// Jointed arm through the points, with a hand at the last.
void robot_arm(Mesh& mesh, const std::vector<Vec3>& joints, double radius);
/// Rocket nozzle of the given exit radius opening to +x.
void nozzle(Mesh& mesh, const Rigid3& T, double exit_radius);

}  // namespace narpa::scenes
