#include "rehearsal/contact/terrain.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "rehearsal/scenario/scenario.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {

Result<std::unique_ptr<const Terrain>> Terrain::create(const Scenario& scenario) {
    auto scene = read_scene(scenario.scene, scenario.scene_overrides);
    if (!scene) return scene.error();
    std::unique_ptr<Terrain> t(new Terrain(*std::move(scene)));
    auto tracer = Tracer::create(t->scene_);
    if (!tracer) return tracer.error();
    t->tracer_.emplace(*std::move(tracer));
    const auto body = std::ranges::find(t->scene_.bodies, scenario.target.body, &Body::name);
    t->body_ = static_cast<std::uint32_t>(body - t->scene_.bodies.begin());
    t->at_ = BodyPoses(t->scene_.bodies.size());
    t->at_.set(t->body_, inverse(scenario.target.T_body_port));
    t->reach_m_ = 2 * (t->tracer_->bounding_radius_m(t->body_) + norm(scenario.target.T_body_port.t));
    return std::unique_ptr<const Terrain>(std::move(t));
}

std::optional<Terrain::Ground> Terrain::below(const Vec3& point_m) const {
    RayBatch rays;
    HitBatch hits;
    rays.n = 1;
    rays.put(0, {Vec3{reach_m_, point_m.y, point_m.z}, Vec3{-1, 0, 0}});
    tracer_->intersect(at_, rays, {&body_, 1}, hits);
    if ((hits.met & 1) == 0) return std::nullopt;
    const Vec3 normal = hits.geometric_normal[0];
    return Ground{hits.position[0].x, normal.x < 0 ? -normal : normal};
}

std::optional<Footing> footing(const Terrain& terrain, std::span<const Vec3> feet_m) {
    assert(feet_m.size() >= 3);
    constexpr double kSpacing_m = 0.05;
    Eigen::MatrixX3d A(static_cast<Eigen::Index>(feet_m.size()), 3);
    Eigen::VectorXd heights(static_cast<Eigen::Index>(feet_m.size()));
    Vec3 middle;
    for (const Vec3& foot : feet_m) middle += foot / static_cast<double>(feet_m.size());
    double radius_m = 0;
    for (std::size_t i = 0; i < feet_m.size(); ++i) {
        const Vec3 from_middle = feet_m[i] - middle;
        radius_m = std::max(radius_m, std::hypot(from_middle.y, from_middle.z));
        const auto ground = terrain.below(feet_m[i]);
        if (!ground) return std::nullopt;
        A.row(static_cast<Eigen::Index>(i)) << 1, from_middle.y, from_middle.z;
        heights[static_cast<Eigen::Index>(i)] = ground->height_m;
    }
    const Eigen::Vector3d plane = A.colPivHouseholderQr().solve(heights);
    Footing f{std::atan(std::hypot(plane[1], plane[2])), 0};
    for (double y = -radius_m; y <= radius_m; y += kSpacing_m)
        for (double z = -radius_m; z <= radius_m; z += kSpacing_m) {
            if (std::hypot(y, z) > radius_m) continue;
            if (const auto ground = terrain.below({0, middle.y + y, middle.z + z}))
                f.step_m = std::max(f.step_m, ground->height_m - (plane[0] + plane[1] * y + plane[2] * z));
        }
    return f;
}

}  // namespace narpa::rehearsal
