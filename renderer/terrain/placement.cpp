#include "renderer/terrain/placement.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace narpa {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Vec3 on_ellipsoid_at(double longitude, double latitude, double height, double a, double b) {
    const double s = std::sin(latitude), c = std::cos(latitude), e2 = 1 - (b / a) * (b / a);
    const double n = a / std::sqrt(1 - e2 * s * s);
    return {(n + height) * c * std::cos(longitude), (n + height) * c * std::sin(longitude),
            (n * (1 - e2) + height) * s};
}

}  // namespace

bool Placement::place(std::span<Vec3> posts) const {
    std::vector<double> x(posts.size()), y(posts.size());
    std::vector<int> pole(posts.size());
    for (std::size_t i = 0; i < posts.size(); ++i) {
        double column = posts[i].x / refinement_factor, row = posts[i].y / refinement_factor;
        if (around > 0 && column >= around) column -= around;
        if (first_pole != 0 && row <= 0) pole[i] = first_pole;
        if (last_pole != 0 && row >= last_row) pole[i] = last_pole;
        // The pole is half a post beyond the map's first or last row; never farther, as there is no latitude.
        constexpr double kHalf = 0.49;
        if (last_pole != 0 && row > last_row - 1) row = last_row - 1 + kHalf * (row - last_row + 1);
        if (first_pole != 0) row = row < 1 ? kHalf * (row - 1) : row - 1;
        x[i] = map[0] + column * map[1] + row * map[2];
        y[i] = map[3] + column * map[4] + row * map[5];
    }
    if (!on_ellipsoid) {
        for (std::size_t i = 0; i < posts.size(); ++i)
            posts[i] = {(x[i] - x0) * metres_per_x, (y[i] - y0) * metres_per_y, posts[i].z};
        return true;
    }
    if (to_lon_lat) {
        if (!to_lon_lat(x, y)) return false;
    } else {
        for (std::size_t i = 0; i < posts.size(); ++i) x[i] *= kDegree, y[i] *= kDegree;
    }
    for (std::size_t i = 0; i < posts.size(); ++i) {
        posts[i] = pole[i] != 0 ? Vec3{0, 0, pole[i] * (polar_m + posts[i].z)}
                                : on_ellipsoid_at(x[i], y[i], posts[i].z, equatorial_m, polar_m);
        posts[i] = T_body_planet * posts[i];
        if (!is_finite(posts[i])) return false;
    }
    return true;
}

Vec3 Placement::up(const Vec3& position) const {
    if (!on_ellipsoid) return {0, 0, 1};
    const Vec3 p = inverse(T_body_planet) * position, axes{equatorial_m, equatorial_m, polar_m};
    return T_body_planet.q * normalized(p / axes / axes);
}

}  // namespace narpa
