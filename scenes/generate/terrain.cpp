#include "scenes/generate/scenes.h"

#include <cmath>

#include "scenes/generate/noise.h"

namespace narpa::scenes {
namespace {

constexpr int kCells = static_cast<int>(kTerrainSide);

struct Crater {
    double x, y, radius;
};

/// Ten times smaller, a hundred times as many.
std::vector<Crater> craters() {
    constexpr int kCount = 220;
    constexpr double kSmallest = 3, kLargest = 40;
    Random random(11);
    std::vector<Crater> all;
    for (int i = 0; i < kCount; ++i) {
        const double part = random.uniform(std::pow(kSmallest / kLargest, 2), 1);
        all.push_back({random.uniform(-0.5, 0.5) * kTerrainSide, random.uniform(-0.5, 0.5) * kTerrainSide,
                       kSmallest / std::sqrt(part)});
    }
    return all;
}

/// A bowl with a raised rim that falls off outside.
double crater_height(double distance, double radius) {
    const double r = distance / radius, depth = 0.3 * radius, rim = 0.06 * radius;
    if (r < 1) return (depth + rim) * r * r - depth;
    return rim * std::exp(-4 * (r - 1));
}

double hills(double x, double y) {
    double sum = 0, amplitude = 13, wavelength = 110;
    for (std::uint64_t octave = 0; octave < 6; ++octave, amplitude *= 0.47, wavelength *= 0.5)
        sum += amplitude * value_noise(x / wavelength, y / wavelength, 400 + octave);
    return sum;
}

}  // namespace

std::vector<MaterialSpec> terrain_materials() {
    return {{"ground", {0.4, 0.4, 0.4}, {}, 1, "ground.png"}};
}

Mesh build_terrain() {
    const auto holes = craters();
    const auto height = [&holes](double x, double y) {
        double z = hills(x, y);
        for (const Crater& c : holes)
            if (const double d = std::hypot(x - c.x, y - c.y); d < 2.5 * c.radius) z += crater_height(d, c.radius);
        return z;
    };
    Mesh mesh;
    mesh.begin("terrain", "ground");
    mesh.grid(
        kCells, kCells, false,
        [&](int i, int j) {
            const double x = i - 0.5 * kCells, y = j - 0.5 * kCells;
            return Vec3{x, y, height(x, y)};
        },
        [](int i, int j) {
            return Uv{static_cast<double>(i) / kCells, static_cast<double>(j) / kCells};
        });
    return mesh;
}

}  // namespace narpa::scenes
