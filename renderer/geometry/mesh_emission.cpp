// The emissive faces of a mesh, as a light source.
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/constants.h"
#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

/// Each face is chosen in proportion to its area times its radiance.
class MeshEmission final : public EmissiveSurface {
public:
    MeshEmission(const Scene& scene, const Mesh& mesh, std::optional<int> material) : scene_(scene), mesh_(mesh) {
        double sum = 0;
        for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
            // A texture counts as white, which is its upper bound, so that every emissive face can be chosen.
            const double radiance = radiance_of(material ? *material : mesh.face_material[f]);
            const double area = 0.5 * norm(cross(corner(f, 1) - corner(f, 0), corner(f, 2) - corner(f, 0)));
            if (!(radiance > 0) || !(area > 0)) continue;
            faces_.push_back(f);
            cumulative_.push_back(sum += area * radiance);
        }
        if (faces_.empty()) return;
        Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
        const auto for_each_corner = [&](const auto& visit) {
            for (const std::uint32_t face : faces_)
                for (std::size_t k = 0; k < 3; ++k) visit(corner(face, k));
        };
        for_each_corner([&](const Vec3& p) {
            for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
        });
        properties_ = {0.5 * (low + high), 0, sum};
        for_each_corner([&](const Vec3& p) {
            properties_.radius_m = std::max(properties_.radius_m, norm(p - properties_.centre_m));
        });
    }

    [[nodiscard]] Sample sample(const EmitterView& view, double choice, double u,
                                double v) const noexcept override {
        const auto chosen =
            std::upper_bound(cumulative_.begin(), cumulative_.end() - 1, choice * cumulative_.back());
        const std::uint32_t face = faces_[static_cast<std::size_t>(chosen - cumulative_.begin())];
        const double from_first = std::sqrt(u);
        const Vec3 point =
            (1 - from_first) * corner(face, 0) + from_first * ((1 - v) * corner(face, 1) + v * corner(face, 2));
        return {normalized(view.way_to(point)), face};
    }
    [[nodiscard]] double pdf(const EmitterView&, const Vec3& direction, const Hit& met) const noexcept override {
        const double per_area = radiance_of(met.material) / cumulative_.back();
        return per_area * met.range_m * met.range_m / std::abs(dot(direction, met.geometric_normal));
    }

private:
    [[nodiscard]] double radiance_of(int material) const noexcept {
        return mean_band(vec_cast<double>(scene_.materials[static_cast<std::size_t>(material)].emission));
    }
    [[nodiscard]] Vec3 corner(std::uint32_t face, std::size_t k) const noexcept {
        return mesh_.origin_m + vec_cast<double>(mesh_.positions[mesh_.faces[face][k]]);
    }

    const Scene& scene_;
    const Mesh& mesh_;
    std::vector<std::uint32_t> faces_;
    std::vector<double> cumulative_;  ///< of area times radiance, W/sr
};

}  // namespace

std::unique_ptr<const EmissiveSurface> mesh_emission(const Scene& scene, const Mesh& mesh,
                                                     std::optional<int> material) {
    const auto shines = [&](std::size_t m) { return scene.materials[m].emission != Rgb{}; };
    if (material ? !shines(static_cast<std::size_t>(*material)) : std::ranges::none_of(mesh.face_material, shines))
        return nullptr;
    auto emission = std::make_unique<MeshEmission>(scene, mesh, material);
    if (!(emission->properties().power > 0)) return nullptr;
    return emission;
}

}  // namespace narpa
