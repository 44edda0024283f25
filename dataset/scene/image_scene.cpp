#include "dataset/scene/image_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "base/constants.h"

namespace narpa::dataset {
namespace {

/// Removes the bodies that are not to be kept, with lights and air that belong to them.
void remove_bodies(const std::vector<bool>& kept, Scene& scene, Roles& roles, std::vector<int>& ids) {
    std::vector<int> index(kept.size(), -1);
    std::vector<Body> bodies;
    for (std::size_t i = 0; i < kept.size(); ++i)
        if (kept[i]) {
            index[i] = static_cast<int>(bodies.size());
            bodies.push_back(std::move(scene.bodies[i]));
        }
    std::erase_if(ids, [&](int id) { return !kept[static_cast<std::size_t>(id - 1)]; });
    scene.bodies = std::move(bodies);
    const auto moved = [&](int body) { return body < 0 ? -1 : index[static_cast<std::size_t>(body)]; };
    std::erase_if(scene.lights, [&](const Light& l) { return l.mount >= 0 && moved(l.mount) < 0; });
    for (Light& light : scene.lights) light.mount = moved(light.mount);
    for (Camera& camera : scene.cameras) camera.mount = moved(camera.mount);
    if (scene.atmosphere) {
        scene.atmosphere->body = moved(scene.atmosphere->body);
        if (scene.atmosphere->body < 0) scene.atmosphere.reset();
    }
    roles.target = static_cast<std::size_t>(index[roles.target]);
    roles.mount = moved(roles.mount);
    roles.backdrop = moved(roles.backdrop);
    for (std::size_t& body : roles.attached) body = static_cast<std::size_t>(index[body]);
}

Status show_backdrop(const Backdrop& backdrop, Scene& scene, Roles& roles, std::vector<int>& ids) {
    if (backdrop.kind == Backdrop::Kind::scene) return Ok{};
    std::vector<bool> kept(scene.bodies.size(), false);
    kept[roles.target] = true;
    for (const std::size_t body : roles.attached) kept[body] = true;
    if (roles.mount >= 0) kept[static_cast<std::size_t>(roles.mount)] = true;
    if (backdrop.kind == Backdrop::Kind::stars && !scene.stars)
        return Error{"has no [stars], expected them for the background \"stars\"", scene.file};
    if (backdrop.kind == Backdrop::Kind::none) scene.stars.reset();
    if (backdrop.kind == Backdrop::Kind::body) {
        const auto body = std::ranges::find(scene.bodies, backdrop.body, &Body::name);
        if (body == scene.bodies.end())
            return Error{fmt::format("has no body \"{}\", expected it for the background", backdrop.body),
                         scene.file};
        const auto index = static_cast<std::size_t>(body - scene.bodies.begin());
        if (kept[index])
            return Error{fmt::format("body \"{}\" is the target, attached to it or carries the camera, expected "
                                     "another one for the background",
                                     backdrop.body),
                         scene.file};
        kept[index] = true;
        roles.backdrop = static_cast<int>(index);
    }
    scene.sky.reset();
    remove_bodies(kept, scene, roles, ids);
    return Ok{};
}

/// Those of the target's triangles, or of its exact shape.
std::set<std::size_t> materials_of(const Scene& scene, const Body& body) {
    if (const auto* shape = std::get_if<ExactShape>(&body.shape))
        return {static_cast<std::size_t>(shape->material)};
    if (body.mesh_material) return {static_cast<std::size_t>(*body.mesh_material)};
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(std::get<int>(body.shape))];
    return {mesh.face_material.begin(), mesh.face_material.end()};
}

}  // namespace

BodyPoses Placement::poses() const {
    BodyPoses at(T_world_body.size());
    for (std::size_t i = 0; i < T_world_body.size(); ++i) at.set(i, T_world_body[i]);
    return at;
}

Result<std::shared_ptr<ImageScene>> ImageScene::create(Scene scene, Roles roles, const Backdrop& backdrop,
                                                       int threads) {
    std::shared_ptr<ImageScene> made(new ImageScene);
    scene.lidars.clear();
    made->body_ids_.resize(scene.bodies.size());
    std::iota(made->body_ids_.begin(), made->body_ids_.end(), 1);
    if (auto good = show_backdrop(backdrop, scene, roles, made->body_ids_); !good) return good.error();
    made->scene_ = std::move(scene);
    made->roles_ = std::move(roles);
    for (const Body& body : made->scene_.bodies) made->T_world_body_.push_back(motion_at(body, 0).T_world_body);
    for (const std::size_t m : materials_of(made->scene_, made->scene_.bodies[made->roles_.target]))
        made->albedos_.emplace_back(m, made->scene_.materials[m].diffuse);
    auto render_scene = RenderScene::create(made->scene_, threads);
    if (!render_scene) return render_scene.error();
    made->render_scene_.emplace(*std::move(render_scene));
    return made;
}

Placement ImageScene::place(const ImageDraw& draw) const {
    Placement p;
    const Vec3 target = T_world_body_[roles_.target].t;
    p.T_world_camera = {draw.q_world_camera, target - draw.q_world_camera * draw.T_camera_target.t};
    p.T_world_body = T_world_body_;
    p.T_world_body[roles_.target] = {normalized(draw.q_world_camera * draw.T_camera_target.q), target};
    const Rigid3 moved = p.T_world_body[roles_.target] * inverse(T_world_body_[roles_.target]);
    for (const std::size_t body : roles_.attached) p.T_world_body[body] = moved * T_world_body_[body];
    if (roles_.mount >= 0)
        p.T_world_body[static_cast<std::size_t>(roles_.mount)] =
            p.T_world_camera * inverse(camera().T_mount_camera);
    if (roles_.backdrop >= 0) {
        const auto body = static_cast<std::size_t>(roles_.backdrop);
        const double distance_m = norm(T_world_body_[body].t - target);
        const double half_rad = std::asin(std::min(1.0, tracer().bounding_radius_m(body) / distance_m));
        const Quat aside = exp_rotation(half_rad * draw.backdrop_offset);
        const Vec3 line =
            shortest_rotation({0, 0, 1}, normalized(draw.T_camera_target.t)) * (aside * Vec3{0, 0, 1});
        p.T_world_body[body] = {draw.q_world_backdrop, target + distance_m * (draw.q_world_camera * line)};
    }
    return p;
}

void ImageScene::set_albedo_factor(double factor) {
    for (const auto& [index, own] : albedos_) {
        Material& m = scene_.materials[index];
        for (int band = 0; band < 3; ++band)
            m.diffuse[band] = std::min(static_cast<float>(factor * static_cast<double>(own[band])),
                                       std::max(own[band], 1 - m.specular[band]));
    }
}

}  // namespace narpa::dataset
