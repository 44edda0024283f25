/// renderer/terrain/placement.h - maps the posts of a DEM to positions in their body's frame.
#pragma once

#include <array>
#include <functional>
#include <span>

#include "base/pose.h"

namespace narpa {

/// On a plane: x, y from the map, z the height. On an ellipsoid: geodetic longitude and latitude, and the height
/// along the ellipsoid's normal.
struct Placement {
    std::array<double, 6> map{0, 1, 0, 0, 0, -1};  ///< x = [0] + col [1] + row [2], y = [3] + col [4] + row [5]
    bool on_ellipsoid = false;

    double metres_per_x = 1, metres_per_y = 1;  ///< on a plane
    double x0 = 0, y0 = 0;                      ///< map coordinates of the plane's origin

    /// Map coordinates to longitude and latitude in radians, in place; false where one has none. Empty: the map has
    /// degrees.
    std::function<bool(std::span<double> x, std::span<double> y)> to_lon_lat;
    double equatorial_m = 0, polar_m = 0;  ///< semi-axes
    Rigid3 T_body_planet{};
    int around = 0;  ///< columns of the file if it goes around the planet (one more closes the circle); else 0
    int first_pole = 0, last_pole = 0;  ///< a row added at the pole: 1 north, -1 south, 0 none
    int last_row = 0;                   ///< index of the row of last_pole, if any
    int refinement_factor = 1;          ///< refinement of the grid over the file's

    /// (column, row, height) to positions in the body's frame, in place. False where one has none.
    [[nodiscard]] bool place(std::span<Vec3> posts) const;
    /// Unit vector upwards at a position.
    [[nodiscard]] Vec3 up(const Vec3& position) const;
    /// Largest depth of a chord of this length below the reference surface.
    [[nodiscard]] double sag_m(double chord_m) const {
        return on_ellipsoid ? chord_m * chord_m / (8 * (polar_m < equatorial_m ? polar_m : equatorial_m)) : 0;
    }
};

}  // namespace narpa
