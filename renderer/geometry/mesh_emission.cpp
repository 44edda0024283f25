// The emissive faces of a mesh, as a light source.
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/constants.h"
#include "renderer/geometry/emission_tree.h"
#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

double radiance_of(const Scene& scene, int material) noexcept {
    return mean_band(vec_cast<double>(scene.materials[static_cast<std::size_t>(material)].emission));
}

std::vector<EmissiveFace> emissive_faces(const Scene& scene, const Mesh& mesh, std::optional<int> material) {
    std::vector<EmissiveFace> faces;
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
        // A texture counts as white, which is its upper bound, so that every emissive face can be chosen.
        const double radiance = radiance_of(scene, material ? *material : mesh.face_material[f]);
        EmissiveFace e{f};
        for (std::size_t k = 0; k < 3; ++k)
            e.corner_m[k] = mesh.origin_m + vec_cast<double>(mesh.positions[mesh.faces[f][k]]);
        const double area = 0.5 * norm(cross(e.corner_m[1] - e.corner_m[0], e.corner_m[2] - e.corner_m[0]));
        e.power = area * radiance;
        if (e.power > 0) faces.push_back(e);
    }
    return faces;
}

class MeshEmission final : public EmissiveSurface {
public:
    MeshEmission(const Scene& scene, const Mesh& mesh, std::optional<int> material)
        : scene_(scene), tree_(emissive_faces(scene, mesh, material)) {
        if (tree_.faces().empty()) return;
        Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
        double sum = 0;
        for (const EmissiveFace& f : tree_.faces()) {
            sum += f.power;
            for (const Vec3& p : f.corner_m)
                for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
        }
        properties_ = {0.5 * (low + high), 0, sum};
        for (const EmissiveFace& f : tree_.faces())
            for (const Vec3& p : f.corner_m)
                properties_.radius_m = std::max(properties_.radius_m, norm(p - properties_.centre_m));
    }

    [[nodiscard]] Sample sample(const EmitterView& view, double choice, double u,
                                double v) const noexcept override {
        const std::optional<std::size_t> chosen = tree_.choose(seen(view), choice);
        if (!chosen) return {{kInfinity, kInfinity, kInfinity}};
        const EmissiveFace& f = tree_.faces()[*chosen];
        const double from_first = std::sqrt(u);
        const Vec3 point =
            (1 - from_first) * f.corner_m[0] + from_first * ((1 - v) * f.corner_m[1] + v * f.corner_m[2]);
        return {normalized(view.way_to(point)), f.face};
    }
    [[nodiscard]] double pdf(const EmitterView& view, const Vec3& direction,
                             const Hit& met) const noexcept override {
        const double per_area =
            radiance_of(scene_, met.material) * tree_.probability_per_power(seen(view), met.face);
        return per_area * met.range_m * met.range_m / std::abs(dot(direction, met.geometric_normal));
    }

private:
    [[nodiscard]] static EmissionTree::Seen seen(const EmitterView& view) noexcept {
        return {view.to_body(view.way_to({})), view.to_body(view.up)};
    }

    const Scene& scene_;
    const EmissionTree tree_;
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
