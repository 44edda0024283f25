#include "dataset/scene/keypoints.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"

namespace narpa::dataset {
namespace {

std::vector<Vec3> vertices_of(const Mesh& mesh) {
    std::vector<bool> used(mesh.positions.size(), false);
    for (const auto& face : mesh.faces)
        for (const std::uint32_t corner : face) used[corner] = true;
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < used.size(); ++i)
        if (used[i]) points.push_back(mesh.origin_m + vec_cast<double>(mesh.positions[i]));
    return points;
}

/// Unit vectors that are spread evenly: a Fibonacci lattice.
Vec3 lattice_direction(int i, int count) {
    const double z = 1 - (2 * i + 1.0) / count, r = std::sqrt(1 - z * z), a = i * kPi * (3 - std::sqrt(5.0));
    return {r * std::cos(a), r * std::sin(a), z};
}

/// The target alone, in its own axes.
class LoneBody {
public:
    LoneBody(const Tracer& tracer, std::size_t body)
        : tracer_(tracer), only_{static_cast<std::uint32_t>(body)}, at_(tracer.scene().bodies.size()) {
        const BodyBounds& bounds = tracer.bounds(body);
        middle_m_ = bounds.centre_m;
        radius_m_ = std::max({bounds.semi_axes_m.x, bounds.semi_axes_m.y, bounds.semi_axes_m.z});
    }

    /// Points that rays from outside meet on their way to the middle.
    [[nodiscard]] std::vector<Vec3> surface_points() const {
        constexpr int kRays = 4096;
        std::vector<Vec3> points;
        for (int i = 0; i < kRays; ++i) {
            const Vec3 out = lattice_direction(i, kRays);
            if (const Hit hit = first_hit({middle_m_ + 2 * radius_m_ * out, -out}); hit.body >= 0)
                points.push_back(hit.position);
        }
        return points;
    }
    /// Whether more than a third of all directions see the point.
    [[nodiscard]] bool is_exposed(const Vec3& point) const {
        constexpr int kDirections = 96;
        const double far_m = 3 * radius_m_, tolerance_m = 1e-3 * radius_m_;
        int seen = 0;
        for (int i = 0; i < kDirections; ++i) {
            const Vec3 out = lattice_direction(i, kDirections);
            const Hit hit = first_hit({point + far_m * out, -out});
            seen += hit.body < 0 || hit.range_m > far_m - tolerance_m ? 1 : 0;
        }
        return 3 * seen > kDirections;
    }

private:
    [[nodiscard]] Hit first_hit(const Ray& ray) const {
        RayBatch rays;
        rays.put(rays.n++, ray);
        HitBatch hits;
        tracer_.intersect(at_, rays, only_, hits);
        return hits[0];
    }

    const Tracer& tracer_;
    std::array<std::uint32_t, 1> only_;
    BodyPoses at_;  ///< the body's axes are the world's
    Vec3 middle_m_{};
    double radius_m_ = 0;
};

std::size_t index_of_largest(const std::vector<double>& values) {
    return static_cast<std::size_t>(std::max_element(values.begin(), values.end()) - values.begin());
}

}  // namespace

std::vector<Vec3> farthest_points(const std::vector<Vec3>& points, int count,
                                  const std::function<bool(const Vec3&)>& good) {
    std::vector<Vec3> chosen;
    if (points.empty()) return chosen;
    Vec3 middle{};
    for (const Vec3& p : points) middle += p / static_cast<double>(points.size());
    std::vector<double> distance2;
    for (const Vec3& p : points) distance2.push_back(dot(p - middle, p - middle));
    while (chosen.size() < static_cast<std::size_t>(count)) {
        const std::size_t next = index_of_largest(distance2);
        if (!(distance2[next] > 0)) break;
        const Vec3 p = points[next];
        distance2[next] = 0;
        if (!good(p)) continue;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const double d2 = dot(points[i] - p, points[i] - p);
            const bool is_left_out = distance2[i] == 0;
            distance2[i] = is_left_out ? 0 : chosen.empty() ? d2 : std::min(distance2[i], d2);
        }
        chosen.push_back(p);
    }
    return chosen;
}

std::vector<Vec3> chosen_keypoints(const ImageScene& scene, int count) {
    const std::size_t target = scene.roles().target;
    const LoneBody alone(scene.tracer(), target);
    const int* const mesh = std::get_if<int>(&scene.scene().bodies[target].shape);
    return farthest_points(
        mesh ? vertices_of(scene.scene().meshes[static_cast<std::size_t>(*mesh)]) : alone.surface_points(), count,
        [&](const Vec3& p) { return alone.is_exposed(p); });
}

}  // namespace narpa::dataset
