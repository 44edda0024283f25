#include "renderer/assets/images/texture_file.h"
#include "renderer/assets/meshes/mesh_readers.h"

#include <algorithm>

namespace narpa {

namespace {

constexpr float kOrdinaryIor = 1.5f;  ///< glass and plastics; the default of glTF

float clamped(float x, float high) {
    return x > 0 ? std::min(x, high) : 0.0f;  // NaN is 0
}
Rgb clamped(const Rgb& c, float high) {
    return {clamped(c.x, high), clamped(c.y, high), clamped(c.z, high)};
}
bool is_black(const Rgb& c) {
    return !(c.x > 0 || c.y > 0 || c.z > 0);
}

Material named(std::string name, const BsdfKind* kind, const Rgb& emission) {
    Material m{.name = std::move(name), .kind = kind};
    m.emission = clamped(emission, 1e30f);
    return m;
}

Material polished(std::string name, const Rgb& reflectance, const Rgb& emission) {
    Material m = named(std::move(name), &kinds::mirror, emission);
    m.specular = clamped(reflectance, 1);
    return m;
}

/// The values of `illum` for glass in the MTL specification, and those for ray-traced reflection without glass.
bool is_glass(int illum) {
    return illum == 4 || illum == 6 || illum == 7 || illum == 9;
}
bool is_reflecting(int illum) {
    return illum == 3 || illum == 5;
}

Material material_from_mtl(const MtlMaterial& given) {
    constexpr float kPolished = 1000;  // the highest Ns that most programs write
    const float unsaid = given.map_kd.named() ? 1.0f : 0.5f;
    const Rgb kd = given.kd.value_or(Rgb{unsaid, unsaid, unsaid});
    const float glow = given.map_ke.named() ? 1.0f : 0.0f;
    const Rgb ke = given.ke.value_or(Rgb{glow, glow, glow});
    if (is_glass(given.illum) && given.transparent() && given.ni > 1.0f)
        return smooth_glass(given.name, *given.ni, ke);
    if (given.pr || given.pm)
        return metallic_roughness(given.name, kd, given.pm.value_or(0.0f), given.pr.value_or(0.5f),
                                  given.ni.value_or(kOrdinaryIor), ke);
    if (is_reflecting(given.illum) && is_black(kd) && !is_black(given.ks) && given.ns >= kPolished)
        return polished(given.name, given.ks, ke);
    const bool no_highlight = given.illum == 0 || given.illum == 1;
    return diffuse_and_lobe(given.name, kd, no_highlight ? Rgb{} : given.ks, given.ns, ke);
}

}  // namespace

Rgb linear_colour(const Rgb& srgb) {
    const auto linear = [](float code) { return static_cast<float>(linear_from_srgb(static_cast<double>(code))); };
    return {linear(srgb.x), linear(srgb.y), linear(srgb.z)};
}

MeshMaterial from_mtl(const MtlMaterial& given) {
    MeshMaterial out{.material = material_from_mtl(given),
                     .is_grey_by_default = !given.kd && !given.map_kd.named(),
                     .colour = given.map_kd,
                     .emission = given.map_ke,
                     .normal = given.norm,
                     .bump = given.bump,
                     .bump_multiplier = given.bump_multiplier};
    if (given.norm.named()) out.material.normal_scale = clamped(given.bump_multiplier.value_or(1.0f), 100);
    return out;
}

Material diffuse_and_lobe(std::string name, Rgb kd, Rgb ks, float exponent, const Rgb& emission) {
    kd = clamped(kd, 1), ks = clamped(ks, 1);
    const float most = std::max({1.0f, kd.x + ks.x, kd.y + ks.y, kd.z + ks.z});
    Material m = named(std::move(name), is_black(ks) ? &kinds::lambert : &kinds::phong, emission);
    m.diffuse = kd / most;
    m.specular = ks / most;
    m.exponent = clamped(exponent, 1e4f);
    return m;
}

Material metallic_roughness(std::string name, const Rgb& base_colour, float metallic, float roughness, float ior,
                            const Rgb& emission) {
    Material m = named(std::move(name), &kinds::ggx, emission);
    m.diffuse = clamped(base_colour, 1);
    m.metallic = clamped(metallic, 1);
    m.roughness = clamped(roughness, 1);
    m.ior = ior > 1 ? std::min(ior, 3.0f) : kOrdinaryIor;
    return m;
}

Material smooth_glass(std::string name, float ior, const Rgb& emission) {
    Material m = named(std::move(name), &kinds::dielectric, emission);
    m.ior = ior > 1 ? std::min(ior, 10.0f) : kOrdinaryIor;
    return m;
}

}  // namespace narpa
