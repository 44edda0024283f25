// Lambert's law; evaluated in bsdf.cpp.
#include <numbers>

#include "renderer/material/bsdf_kind.h"
#include "renderer/material/material_keys.h"

namespace narpa {
namespace {

constexpr TableKey kLambertRows[]{kAlbedoRow, kTextureRow, kCloudTextureRow, kCloudAlbedoRow};

Rgb lambert_f(const Surface& s, const BsdfGeometry&) noexcept {
    return s.diffuse * static_cast<float>(std::numbers::inv_pi);
}

}  // namespace

constinit const BsdfKind kinds::lambert{.name = "lambert",
                                        .keys = kLambertRows,
                                        .read = read_albedo,
                                        .lambert_or_phong = true,
                                        .f = lambert_f,
                                        .largest_albedo = [](const Material& m) noexcept { return m.diffuse; }};

}  // namespace narpa
