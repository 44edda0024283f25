/// scenes/generate/shapes.h - closed solids that the station and the chaser are made of. Metres.
///
/// `T` takes the solid's own coordinates to the body's. Solids of revolution turn about their own x axis.
#pragma once

#include <functional>
#include <vector>

#include "base/constants.h"
#include "scenes/generate/mesh.h"

namespace narpa::scenes {

/// Texture scale where nothing else is said: 1 cm a texel in a 1024-texel picture.
inline constexpr double kMetresPerTile = 10.24;

/// Frame at `origin` whose x axis points along `x_axis` (any length); its z axis leans to `up` where it can.
Rigid3 frame_along(const Vec3& origin, const Vec3& x_axis, const Vec3& up = {0, 0, 1});

/// Box of half extents `half` about its origin with 45 degree bevels; bevel > 0.
void box(Mesh& mesh, const Rigid3& T, const Vec3& half, double bevel);

/// One point of a profile: `a` along the axis, `r` from it.
struct ProfilePoint {
    double a, r;
};
/// Height added to the radius at (angle, a).
using Relief = std::function<double(double, double)>;

/// Turns a profile about the x axis in `segments` steps. The profile runs from the axis to the axis with `a` rising
/// on the outside, or returns to its first point (a ring). Corners of more than 35 degrees are hard edges.
void lathe(Mesh& mesh, const Rigid3& T, const std::vector<ProfilePoint>& profile, int segments,
           double metres_per_tile = kMetresPerTile, const Relief& relief = {});
/// The same with the texture laid on along the x axis: one tile of `metres_per_tile`, its centre on the axis.
void lathe_facing(Mesh& mesh, const Rigid3& T, const std::vector<ProfilePoint>& profile, int segments,
                  double metres_per_tile);
/// The profile with extra points so that no step is longer than `step`, for relief to show on.
std::vector<ProfilePoint> refined(const std::vector<ProfilePoint>& profile, double step);

/// Capped round bar from p to q.
void tube(Mesh& mesh, const Vec3& p, const Vec3& q, double radius, int segments = 8);
/// Capped round bar through several points, with a ball at each bend.
void pipe(Mesh& mesh, const std::vector<Vec3>& points, double radius, int segments = 8);
void ball(Mesh& mesh, const Vec3& centre, double radius, int segments = 12);

/// A curved plate: shape(u, v, w) with u, v in [0, 1] across it and w from 0 (underside) to 1 (top), right-handed.
/// The top's rim is chamfered: it starts `bevel_u`, `bevel_v` (fractions) inside the plate's edge.
struct Plate {
    int nu = 1, nv = 1;
    double bevel_u = 0.02, bevel_v = 0.02;
    std::function<Vec3(double, double, double)> shape;
    std::function<Uv(double, double)> uv;  ///< of (u, v)
    std::string underside{};               ///< its material, where it is not the top's
};
void plate(Mesh& mesh, const Plate& p);

/// Square truss from p to q: four longerons, battens and diagonals, `bays` times.
void truss(Mesh& mesh, const Vec3& p, const Vec3& q, const Vec3& up, double width, int bays, double tube_radius);
/// Parabolic dish of the given diameter opening to +x, with its feed on a tripod.
void dish(Mesh& mesh, const Rigid3& T, double diameter, const std::string& face, const std::string& structure,
          int segments = 36);
/// Handrail of the given length along T's x axis, standing off along its z axis.
void handrail(Mesh& mesh, const Rigid3& T, double length);

}  // namespace narpa::scenes
