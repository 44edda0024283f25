// The cratered ground of the descent, and the small body.
#include "scenes/generate/noise.h"
#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

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

double hills(double x, double y) {
    double sum = 0, amplitude = 13, wavelength = 110;
    for (std::uint64_t octave = 0; octave < 6; ++octave, amplitude *= 0.47, wavelength *= 0.5)
        sum += amplitude * value_noise(x / wavelength, y / wavelength, 400 + octave);
    return sum;
}

constexpr Vec3 kSemiAxes{28, 20, 17};
constexpr int kMeridians = 360, kParallels = 180;

/// A round feature about a direction: craters go in, boulders come out.
struct Feature {
    Vec3 direction;
    double radius_m;
    bool boulder;
};

Vec3 on_ellipsoid(const Vec3& direction) {
    const Vec3 scaled{direction.x / kSemiAxes.x, direction.y / kSemiAxes.y, direction.z / kSemiAxes.z};
    return direction / norm(scaled);
}

Vec3 random_direction(Random& random) {
    const double z = random.uniform(-1, 1), azimuth = random.uniform(0, 2 * kPi), r = std::sqrt(1 - z * z);
    return {r * std::cos(azimuth), r * std::sin(azimuth), z};
}

/// Half as large, four times as many.
void add_features(int count, double smallest_m, double largest_m, bool boulder, Random& random,
                  std::vector<Feature>& all) {
    for (int i = 0; i < count; ++i) {
        const double part = random.uniform(std::pow(smallest_m / largest_m, 2), 1);
        all.push_back({random_direction(random), smallest_m / std::sqrt(part), boulder});
    }
}

/// A boulder is half of a flattened ball.
double height_m(const Feature& f, double distance_m) {
    if (!f.boulder) return f.radius_m * bowl_profile(distance_m / f.radius_m, 0.22, 0.05);
    const double r = distance_m / f.radius_m;
    return r < 1 ? 0.7 * f.radius_m * std::sqrt(1 - r * r) : 0;
}

/// Waves in directions drawn at random: no seam and no poles.
double hills_m(const Vec3& p) {
    Random random(77);
    double sum = 0, amplitude = 1.6, wavelength = 30;
    for (int octave = 0; octave < 5; ++octave, amplitude *= 0.5, wavelength *= 0.5)
        for (int wave = 0; wave < 6; ++wave) {
            const Vec3 k = 2 * kPi / wavelength * random_direction(random);
            sum += amplitude / 3 * std::sin(dot(k, p) + random.uniform(0, 2 * kPi));
        }
    return sum;
}

}  // namespace

Mesh build_terrain() {
    const auto holes = craters();
    const auto height = [&holes](double x, double y) {
        double z = hills(x, y);
        for (const Crater& c : holes)
            if (const double d = std::hypot(x - c.x, y - c.y); d < 2.5 * c.radius)
                z += c.radius * bowl_profile(d / c.radius, 0.3, 0.06);
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

Mesh build_small_body() {
    Random random(5);
    std::vector<Feature> features;
    add_features(260, 0.5, 9, false, random, features);
    add_features(420, 0.25, 1.5, true, random, features);
    const auto point = [&](int i, int j) {
        const double longitude = 2 * kPi * i / kMeridians,
                     latitude = kPi * (static_cast<double>(j) / kParallels - 0.5);
        const Vec3 direction{std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                             std::sin(latitude)};
        const Vec3 base = on_ellipsoid(direction);
        double up_m = hills_m(base);
        for (const Feature& f : features)
            if (const double d = norm(base - on_ellipsoid(f.direction)); d < 2.5 * f.radius_m)
                up_m += height_m(f, d);
        return base + up_m * direction;
    };
    Mesh mesh;
    mesh.begin("small_body", "regolith");
    mesh.grid(kMeridians, kParallels, true, point, [](int i, int j) {
        return Uv{static_cast<double>(i) / kMeridians, static_cast<double>(j) / kParallels};
    });
    return mesh;
}

}  // namespace narpa::scenes
