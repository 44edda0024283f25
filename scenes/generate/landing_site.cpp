// A landing site on cratered ground, and the lander.
#include <algorithm>
#include <cmath>
#include <vector>

#include "scenes/generate/noise.h"
#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

/// Rings about the site whose spacing grows with their distance: a camera that comes down on it sees equally many
/// triangles from every height.
struct Rings {
    int sectors;
    double min_m;  ///< between rings, and the finest detail

    [[nodiscard]] double part() const { return 2 * kPi / sectors; }
    [[nodiscard]] double spacing_m(double r) const { return std::max(min_m, part() * r); }
    /// Distances from the site.
    [[nodiscard]] std::vector<double> radii() const {
        std::vector<double> all{0};
        while (all.back() < kLandingReach_m) all.push_back(all.back() + spacing_m(all.back()));
        return all;
    }
};
constexpr Rings kGround{256, 0.08}, kMap{256, 0.5};
constexpr double kMapError_m = 0.15, kMapErrorLength_m = 20;  // of heights: about twice the standard deviation

/// From 0 at the site to 1 far beyond `within_m`.
double away(double r, double within_m) {
    return r * r / (r * r + within_m * within_m);
}

constexpr double kHillRatio = 0.045;  // of an octave's height to its wavelength, at 10 m
constexpr double kClear_m = 7;        // about the site: no rock, and no rim of a crater
constexpr double kShown = 6;          // vertices across a bump

double relief_m(double x, double y, double r, double spacing_m) {
    double sum = 0, wavelength = 900;
    for (std::uint64_t octave = 0; octave < 12; ++octave, wavelength *= 0.5) {
        const double resolved = std::clamp(0.5 * wavelength / spacing_m - 1, 0.0, 1.0);
        const double height = kHillRatio * wavelength * std::pow(wavelength / 10, -0.25);
        const double here = wavelength > 6 ? away(r, 0.5 * wavelength) : 0.25 + 0.75 * away(r, 12);
        if (resolved > 0)
            sum += resolved * here * height * value_noise(x / wavelength, y / wavelength, 900 + octave);
    }
    return sum;
}

/// Round: a crater goes in, a rock comes out.
struct Bump {
    double x, y, radius_m, part;  ///< part: height or depth of a fresh one
    bool rock;
};

/// In octaves of size; each as far from the site as the mesh can show it. Half as large, four times as many.
std::vector<Bump> all_bumps() {
    constexpr double kCraters = 0.05, kRocks = 0.012;
    std::vector<Bump> all;
    Random random(23);
    const auto scatter = [&](double smallest_m, double largest_m, double share, bool rock) {
        for (double d = smallest_m; d < largest_m; d *= 2) {
            const double reach = std::min(kLandingReach_m, d / (kShown * kGround.part()));
            const int count = static_cast<int>(0.75 * share / (d * d) * kPi * reach * reach);
            for (int i = 0; i < count; ++i) {
                const double r = reach * std::sqrt(random.uniform()), at = random.uniform(0, 2 * kPi);
                const double size = d / std::sqrt(random.uniform(0.25, 1)), part = random.uniform(0.3, 1);
                if (r > kClear_m + 0.7 * size)
                    all.push_back({r * std::cos(at), r * std::sin(at), size / 2, part, rock});
            }
        }
    };
    scatter(0.8, 400, kCraters, false);
    scatter(0.3, 2, kRocks, true);
    return all;
}

/// Bowl, rim and ejecta of a crater (depth 0.2 of its diameter when fresh); half of a flattened ball.
double bump_height_m(const Bump& f, double distance_m) {
    const double t = distance_m / f.radius_m;
    if (f.rock) return t < 1 ? 0.9 * f.part * f.radius_m * std::sqrt(1 - t * t) : 0;
    return f.radius_m * bowl_profile(t, 0.4 * f.part, 0.08 * f.part);
}

}  // namespace

std::vector<MaterialSpec> lander_materials() {
    return {{"gold", {0.6, 0.45, 0.2}}, {"metal", {0.5, 0.5, 0.5}}};
}

namespace {

Mesh site_mesh(const Rings& rings, double error_m) {
    const auto bumps = all_bumps();
    const auto height = [&](double x, double y) {
        const double r = std::hypot(x, y), spacing = rings.spacing_m(r);
        double z =
            relief_m(x, y, r, spacing) + error_m * value_noise(x / kMapErrorLength_m, y / kMapErrorLength_m, 7700);
        for (const Bump& b : bumps)
            if (const double d = std::hypot(x - b.x, y - b.y); d < 2.5 * b.radius_m && 2 * b.radius_m > 4 * spacing)
                z += bump_height_m(b, d);
        return z;
    };
    const std::vector<double> radii = rings.radii();
    const double site = height(0, 0);
    Mesh mesh;
    mesh.begin("landing_site", "ground");
    mesh.grid(
        rings.sectors, static_cast<int>(radii.size()) - 1, true,
        [&](int i, int j) {
            const double at = -2 * kPi * i / rings.sectors, r = radii[static_cast<std::size_t>(j)];
            const double x = r * std::cos(at), y = r * std::sin(at);
            return Vec3{x, y, height(x, y) - site};
        },
        [&](int i, int j) {
            return Uv{static_cast<double>(i) / rings.sectors, static_cast<double>(j)};
        });
    return mesh;
}

}  // namespace

Mesh build_landing_site() {
    return site_mesh(kGround, 0);
}

Mesh build_landing_map() {
    return site_mesh(kMap, kMapError_m);
}

Mesh build_lander() {
    Mesh mesh;
    mesh.begin("bus", "gold");
    box(mesh, {}, {0.8, 0.8, 0.4}, 0.05);
    mesh.begin("legs", "metal");
    for (int i = 0; i < 4; ++i) {
        const double at = kPi * (i + 0.5) / 2, x = std::cos(at), y = std::sin(at);
        const Vec3 foot{kLanderFeetRadius_m * x, kLanderFeetRadius_m * y, kLanderFeet_m + 0.08};
        tube(mesh, {1.0 * x, 1.0 * y, 0.3}, foot, 0.05);
        tube(mesh, {0.9 * x, 0.9 * y, -0.4}, foot, 0.035);
        lathe(mesh, frame_along(foot - Vec3{0, 0, 0.08}, {0, 0, 1}),
              {{0, 0}, {0, 0.18}, {0.06, 0.18}, {0.08, 0.05}, {0.08, 0}}, 16);
    }
    lathe(mesh, frame_along({0, 0, -0.85}, {0, 0, 1}), {{0, 0.32}, {0.45, 0.1}, {0.45, 0.07}, {0, 0.29}, {0, 0.32}},
          24);
    return mesh;
}

}  // namespace narpa::scenes
