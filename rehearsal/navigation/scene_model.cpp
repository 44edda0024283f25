#include "rehearsal/navigation/scene_model.h"

#include <fmt/format.h>

#include <algorithm>

#include "renderer/scene/scene_file.h"

namespace narpa::rehearsal {
namespace {

template <class Named>
Result<std::size_t> index_of(const std::vector<Named>& all, const std::string& name, const std::string& file) {
    const auto it = std::ranges::find(all, name, &Named::name);
    if (it == all.end()) return Error{fmt::format("\"{}\" is not in this scene", name), file};
    return static_cast<std::size_t>(it - all.begin());
}

template <class Sensor>
Result<std::vector<std::size_t>> on_chaser(const std::vector<Sensor>& all, const std::vector<std::string>& names,
                                           std::size_t chaser, const std::string& file) {
    std::vector<std::size_t> out;
    for (const std::string& name : names) {
        const auto i = index_of(all, name, file);
        if (!i) return i.error();
        if (all[*i].mount != static_cast<int>(chaser))
            return Error{fmt::format("\"{}\" does not ride on the chaser: expected mount = its name", name), file};
        out.push_back(*i);
    }
    return out;
}

}  // namespace

Result<std::unique_ptr<SceneModel>> SceneModel::create(const Scenario& scenario) {
    auto scene = read_scene(scenario.scene);
    if (!scene) return scene.error();
    std::unique_ptr<SceneModel> m(new SceneModel);
    m->scene_ = *std::move(scene);
    m->orbit_ = scenario.orbit;
    m->target_centre_of_mass_m_ = scenario.target.centre_of_mass_m;
    const auto target = index_of(m->scene_.bodies, scenario.target.body, scenario.scene);
    if (!target) return target.error();
    const auto chaser = index_of(m->scene_.bodies, scenario.chaser.body, scenario.scene);
    if (!chaser) return chaser.error();
    m->target_ = *target, m->chaser_ = *chaser;
    if (scenario.attractor) {
        const auto attractor = index_of(m->scene_.bodies, scenario.attractor->first, scenario.scene);
        if (!attractor) return attractor.error();
        m->attractor_ = *attractor;
    }
    auto cameras = on_chaser(m->scene_.cameras, scenario.navigation.cameras, *chaser, scenario.scene);
    if (!cameras) return cameras.error();
    auto lidars = on_chaser(m->scene_.lidars, scenario.navigation.lidars, *chaser, scenario.scene);
    if (!lidars) return lidars.error();
    m->cameras_ = *std::move(cameras), m->lidars_ = *std::move(lidars);
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
    if (attractor_) at_.T_world_body[*attractor_].t = -orbit_.radius_m * (orbit_.q_world_lvlh(t_s) * Vec3{1, 0, 0});
    return at_;
}

}  // namespace narpa::rehearsal
