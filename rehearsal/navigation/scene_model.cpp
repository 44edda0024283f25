#include "rehearsal/navigation/scene_model.h"

#include <algorithm>

#include "renderer/scene/scene_file.h"

namespace narpa::rehearsal {
Result<std::unique_ptr<SceneModel>> SceneModel::create(const Scenario& scenario) {
    auto scene = read_scene(scenario.navigation.scene.empty() ? scenario.scene : scenario.navigation.scene);
    if (!scene) return scene.error();
    std::unique_ptr<SceneModel> m(new SceneModel);
    m->scene_ = *std::move(scene);
    m->orbit_ = scenario.orbit;
    m->target_centre_of_mass_m_ = scenario.target.centre_of_mass_m;
    // read_scenario has found all of them in the scene, and the same names in the navigation's.
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
