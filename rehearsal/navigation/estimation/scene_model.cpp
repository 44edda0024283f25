#include "rehearsal/navigation/estimation/scene_model.h"

#include <algorithm>

#include "renderer/scene/own_mesh.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

/// Applies the navigation's model errors to the scene.
void apply_model_error(const ModelUncertainty& e, std::size_t target, Scene& scene) {
    if (e == ModelUncertainty{}) return;
    const Vec3 along = normalized(Vec3{1, 1, 1});
    if (Mesh* const mesh = own_mesh(scene, target))
        for (Vec3f& p : mesh->positions)
            p = vec_cast<float>((1 + e.scale) * vec_cast<double>(p) + e.mesh_m * along);
    for (Material& m : scene.materials) m.diffuse = static_cast<float>(1 + e.albedo) * m.diffuse;
    if (scene.sun) scene.sun->direction = exp_rotation(e.light_rad * along) * scene.sun->direction;
    const Quat turn = exp_rotation(e.boresight_rad * along);
    for (Camera& c : scene.cameras) {
        if (const Pinhole* p = c.model->pinhole())  // a calibrated lens is unchanged
            c.model = std::make_shared<const Pinhole>(p->fx * (1 + e.focal), p->fy * (1 + e.focal), p->cx, p->cy);
        c.T_mount_camera.q = c.T_mount_camera.q * turn;
    }
    for (Lidar& l : scene.lidars) l.T_mount_lidar.q = l.T_mount_lidar.q * turn;
}

}  // namespace

Result<std::unique_ptr<SceneModel>> SceneModel::create(const Scenario& scenario) {
    const std::string& map = scenario.navigation.scene;
    auto scene = map.empty() ? read_scene(scenario.scene, scenario.scene_overrides)
                             : read_scene(map, scenario.map_overrides);
    if (!scene) return scene.error();
    std::unique_ptr<SceneModel> m(new SceneModel);
    m->scene_ = *std::move(scene);
    m->orbit_ = scenario.orbit;
    m->target_centre_of_mass_m_ = scenario.target.centre_of_mass_m;
    // read_scenario has checked that all of these are in the scene, and in the navigation's scene.
    const auto index_of = [](const auto& all, const std::string& name) {
        const auto has_name = [&](const auto& named) { return named.name == name; };
        return static_cast<std::size_t>(std::ranges::find_if(all, has_name) - all.begin());
    };
    m->target_ = index_of(m->scene_.bodies, scenario.target.body);
    m->chaser_ = index_of(m->scene_.bodies, scenario.chaser.body);
    if (scenario.attractor) m->attractor_ = index_of(m->scene_.bodies, scenario.attractor->first);
    for (const std::string& name : scenario.navigation.cameras)
        m->cameras_.push_back(index_of(m->scene_.cameras, name));
    for (const std::string& name : scenario.navigation.lidars)
        m->lidars_.push_back(index_of(m->scene_.lidars, name));
    for (const std::string& name : scenario.navigation.velocimeters)
        m->velocimeters_.push_back(index_of(m->scene_.lidars, name));
    m->uncertainty_ = scenario.model_error.uncertainty();
    apply_model_error(scenario.model_error.error, m->target_, m->scene_);
    auto render_scene = RenderScene::create(m->scene_);
    if (!render_scene) return render_scene.error();
    m->render_scene_.emplace(*std::move(render_scene));
    m->at_ = BodyPoses(m->scene_.bodies.size());
    for (std::size_t i = 0; i < m->scene_.bodies.size(); ++i)
        m->at_.set(i, m->scene_.bodies[i].initial.T_world_body);
    return m;
}

const BodyPoses& SceneModel::place(double t_s, const Quat& q_world_target, const Rigid3& T_target_chaser) {
    const Rigid3 T_world_target{q_world_target, -(q_world_target * target_centre_of_mass_m_)};
    at_.set(target_, T_world_target);
    at_.set(chaser_, T_world_target * T_target_chaser);
    if (attractor_)
        at_.T_world_body[*attractor_].t = -orbit_.radius_m * (orbit_.q_world_frame(t_s) * Vec3{1, 0, 0});
    return at_;
}

}  // namespace narpa::rehearsal
