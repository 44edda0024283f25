/// renderer/material/bsdf_kind.h - the kinds of BSDF, one row each. A new kind is a file with its functions and its
/// row, and a line in bsdf_kinds.cpp.
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "renderer/keys/keys.h"
#include "renderer/material/bsdf.h"

namespace narpa {

class TableReader;

/// Directions as in bsdf.h, with n.l > 0 and n.v > 0, and their cosines.
struct BsdfGeometry {
    const Vec3 &n, &l, &v;
    double n_l, n_v, l_v;
};

using Random3 = std::array<double, 3>;

/// Members that a kind does not have are null, false or empty. Functions neither allocate nor throw.
struct BsdfKind {
    std::string_view name;                                    ///< `kind` of a scene's material
    std::span<const TableKey> keys{};                         ///< keys of the material beside those of all kinds
    void (*read)(TableReader& table, Material& m) = nullptr;  ///< reads `keys`, except those of textures

    /// f is kd / pi, plus Phong's lobe (phong_lobe.h) where Surface::specular is not 0. Vector code evaluates these
    /// kinds for many lanes at once, and paths may be reused among their surfaces.
    bool lambert_or_phong = false;
    bool has_lobe = false;     ///< Material::specular scales a lobe
    bool is_delta = false;     ///< scatters into single directions: f and pdf are 0
    bool is_mirror = false;    ///< a LiDAR's beam goes on along the mirrored direction
    bool direct_only = false;  ///< no BRDF: it may reflect more than it gets, so paths cannot use it

    /// f, 1/sr. Not for delta distributions.
    Rgb (*f)(const Surface& s, const BsdfGeometry& g) noexcept = nullptr;
    /// Density per solid angle with which `direction` chooses g.l. Null: the cosine over pi.
    double (*pdf)(const Surface& s, const BsdfGeometry& g) noexcept = nullptr;
    /// Samples l, which may fall below the surface. Null: in proportion to the cosine.
    Vec3 (*direction)(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept = nullptr;
    /// Samples l with its weight at once, in place of the three above.
    BsdfSample (*sample)(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept = nullptr;
    /// ambient_reflectance (bsdf.h). Not for `lambert_or_phong`.
    Rgb (*ambient)(const Surface& s) noexcept = nullptr;
    /// largest_albedo (albedo.h), exact or a bound. Null: by quadrature.
    Rgb (*largest_albedo)(const Material& m) noexcept = nullptr;
    std::string_view
        energy_key{};  ///< key that is at fault where the largest albedo is above 1; empty: it cannot be
};

/// Mean of the bands.
[[nodiscard]] inline double band_mean(const Rgb& c) noexcept {
    return static_cast<double>(c.x + c.y + c.z) / 3;
}

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const BsdfKind* const> bsdf_kinds() noexcept;

}  // namespace narpa
