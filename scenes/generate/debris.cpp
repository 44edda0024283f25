#include <charconv>
#include <fstream>
#include <numbers>
#include <stdexcept>

#include "scenes/generate/noise.h"
#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

/// The cloud expands from its middle: each piece flies at its distance from there in this time.
constexpr double kSinceBreakup_s = 2400;
constexpr double kMiddle_m = 70, kSpread_m = 16;
constexpr double kTumble_rad_s = 0.5;

Vec3 normal_vector(Random& random) {
    const auto normal = [&] {
        const double radius = std::sqrt(-2 * std::log(1 - random.uniform()));
        return radius * std::cos(2 * std::numbers::pi * random.uniform());
    };
    const double x = normal(), y = normal(), z = normal();
    return {x, y, z};
}

std::string decimals(double number, int digits) {
    char text[32];
    return {text, std::to_chars(text, text + sizeof text, number, std::chars_format::fixed, digits).ptr};
}

std::string debris_row(const std::string& name, Random& random) {
    const Vec3 from_middle = kSpread_m * normal_vector(random), velocity = from_middle / kSinceBreakup_s;
    const Vec3 rate = kTumble_rad_s * normal_vector(random);
    const Quat q = exp_rotation(std::numbers::pi * normal_vector(random));
    const Vec3 at = Vec3{kMiddle_m, 0, 0} + from_middle;
    std::string row = "0," + name;
    for (const double number : {at.x, at.y, at.z}) row += ',' + decimals(number, 3);
    for (const double number : {q.w, q.x, q.y, q.z}) row += ',' + decimals(number, 5);
    for (const Vec3& v : {velocity, rate})
        for (int k = 0; k < 3; ++k) row += ',' + decimals(v[k], 4);
    return row + '\n';
}

}  // namespace

std::vector<MaterialSpec> debris_materials() {
    return {{"foil", {0.30, 0.22, 0.10}, {0.45, 0.38, 0.22}, 40},
            {"cells", {0.03, 0.04, 0.10}, {0.10, 0.10, 0.12}, 200},
            {"metal", {0.25, 0.25, 0.26}, {0.40, 0.40, 0.40}, 30},
            {"white", {0.70, 0.70, 0.68}}};
}

Mesh build_debris(DebrisKind kind) {
    Mesh mesh;
    switch (kind) {
        case DebrisKind::panel:
            mesh.begin("panel", "cells");
            box(mesh, {}, {0.42, 0.25, 0.012}, 0.004);
            break;
        case DebrisKind::rod:
            mesh.begin("rod", "metal");
            tube(mesh, {-0.6, 0, 0}, {0.6, 0.05, 0}, 0.03, 6);
            break;
        case DebrisKind::block:
            mesh.begin("block", "white");
            box(mesh, {}, {0.16, 0.12, 0.10}, 0.01);
            mesh.material("metal");
            box(mesh, {{1, 0, 0, 0}, {0.05, 0.02, 0.12}}, {0.06, 0.05, 0.05}, 0.01);
            break;
        case DebrisKind::flake:
            mesh.begin("flake", "foil");
            lathe(mesh, {}, {{-0.05, 0}, {-0.04, 0.11}, {0.03, 0.13}, {0.06, 0}}, 7, kMetresPerTile,
                  [](double angle, double a) { return 0.03 * std::cos(3 * angle + 40 * a); });
            break;
    }
    return mesh;
}

void write_debris(const std::string& path) {
    std::string text = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n";
    Random random(10000);
    for (int piece = 0; piece < kDebrisPieces; ++piece) {
        const DebrisName& kind = kDebrisNames[static_cast<std::size_t>(piece) % kDebrisNames.size()];
        text += debris_row(kind.name + std::string("-") + std::to_string(piece), random);
    }
    std::ofstream file(path, std::ios::binary);
    file << text;
    if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace narpa::scenes
