#include "dataset/scene/scene_set.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "base/file_bytes.h"
#include "base/fnv1a.h"
#include "dataset/scene/keypoints.h"
#include "renderer/projection/projection_kind.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/scene_file/scene_inputs.h"

namespace narpa::dataset {
namespace {

std::vector<std::string> names_of(const Scene& scene) {
    std::vector<std::string> names;
    for (const Body& body : scene.bodies) names.push_back(body.name);
    return names;
}

Result<std::size_t> body_named(const Scene& scene, const std::string& name, std::string_view what) {
    const auto body = std::ranges::find(scene.bodies, name, &Body::name);
    if (body != scene.bodies.end()) return static_cast<std::size_t>(body - scene.bodies.begin());
    return Error{
        fmt::format("has no body \"{}\", expected one of {} as {}", name, fmt::join(names_of(scene), ", "), what),
        scene.file};
}

/// The recipe's target or, without a name, the first body with a mesh that does not carry the camera, or else the
/// first that does not.
Result<std::size_t> find_target(const Scene& scene, const Recipe& recipe, int mount) {
    if (!recipe.target.empty()) {
        const auto body = body_named(scene, recipe.target, "the target");
        if (body && static_cast<int>(*body) == mount)
            return Error{fmt::format("body \"{}\" carries the camera, expected another target", recipe.target),
                         scene.file};
        return body;
    }
    for (const bool with_mesh : {true, false})
        for (std::size_t i = 0; i < scene.bodies.size(); ++i)
            if (static_cast<int>(i) != mount && (!with_mesh || std::holds_alternative<int>(scene.bodies[i].shape)))
                return i;
    return Error{"has no body but the one that carries the camera, expected a target", scene.file};
}

Result<std::size_t> find_camera(const Scene& scene, const std::string& name) {
    if (scene.cameras.empty()) return Error{"has no camera", scene.file};
    if (name.empty()) return std::size_t{0};
    std::vector<std::string> names;
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
        if (scene.cameras[i].name == name) return i;
        names.push_back(scene.cameras[i].name);
    }
    return Error{fmt::format("has no camera \"{}\", expected one of {}", name, fmt::join(names, ", ")), scene.file};
}

/// Of the files' contents alone: the same wherever they lie.
std::string fingerprint_of(const std::vector<Scene>& scenes) {
    std::set<std::string> files;
    for (const Scene& scene : scenes)
        for (std::string& file : files_of(scene)) files.insert(std::move(file));
    std::multiset<std::uint64_t> hashes;
    for (const std::string& file : files)
        if (const auto bytes = read_file(file)) hashes.insert(fnv1a(*bytes));
    std::uint64_t all = fnv1a("");
    for (const std::uint64_t hash : hashes) all = fnv1a(fmt::format("{:016x}", hash), all);
    return fmt::format("{:016x}", all);
}

}  // namespace

Result<std::unique_ptr<SceneSet>> SceneSet::create(const Recipe& recipe, int threads) {
    std::unique_ptr<SceneSet> set(new SceneSet(recipe, threads));
    if (auto good = set->read(); !good) return good.error();
    if (auto good = set->find_roles(); !good) return good.error();
    if (auto good = set->check_variants(); !good) return good.error();
    if (auto good = set->check_recipe(); !good) return good.error();
    return set;
}

Status SceneSet::read() {
    for (const Variant& variant : recipe_.variants) {
        std::vector<std::string> sets = recipe_.sets;
        sets.insert(sets.end(), variant.sets.begin(), variant.sets.end());
        auto scene = read_scene(recipe_.scene, sets);
        if (!scene) return scene.error();
        for (const std::string& w : scene->warnings)
            if (std::ranges::find(warnings_, w) == warnings_.end()) warnings_.push_back(w);
        for (Camera& camera : scene->cameras) camera.embedded_line = false;  // there is no ledger
        scenes_.push_back(*std::move(scene));
    }
    if (scenes_[0].render.budget_ns > 0)
        warnings_.push_back(
            "budget_ms is not used: images of a data set take the scene's samples per pixel, spp, so "
            "that their bytes do not depend on the machine's speed");
    fingerprint_ = fingerprint_of(scenes_);
    return Ok{};
}

Status SceneSet::check_variants() const {
    for (std::size_t v = 1; v < scenes_.size(); ++v) {
        if (names_of(scenes_[v]) != names_of(scenes_[0]))
            return Error{fmt::format("variant \"{}\" has bodies {}, expected those of all variants: {}",
                                     recipe_.variants[v].name, fmt::join(names_of(scenes_[v]), ", "),
                                     fmt::join(names_of(scenes_[0]), ", ")),
                         recipe_.file};
        const auto index = find_camera(scenes_[v], recipe_.camera);
        if (!index) return index.error();
        const Camera &c = scenes_[v].cameras[*index], &first = camera();
        const auto [kind, p, values] = c.model->parameters();
        const auto [first_kind, first_p, first_values] = first.model->parameters();
        if (*index != roles_.camera || c.width != first.width || c.height != first.height ||
            c.format != first.format || c.mount != first.mount || kind != first_kind || values != first_values ||
            p.fx != first_p.fx || p.fy != first_p.fy || p.cx != first_p.cx || p.cy != first_p.cy)
            return Error{fmt::format("variant \"{}\" changes size, format, projection or mount of camera \"{}\", "
                                     "expected the same in all images",
                                     recipe_.variants[v].name, c.name),
                         recipe_.file};
    }
    return Ok{};
}

Status SceneSet::find_roles() {
    const Scene& scene = scenes_[0];
    const auto index = find_camera(scene, recipe_.camera);
    if (!index) return index.error();
    roles_.camera = *index;
    roles_.mount = camera().mount;
    const auto target = find_target(scene, recipe_, roles_.mount);
    if (!target) return target.error();
    roles_.target = *target;
    for (const std::string& name : recipe_.attached) {
        const auto body = body_named(scene, name, "attached to the target");
        if (!body) return body.error();
        if (*body == roles_.target || static_cast<int>(*body) == roles_.mount)
            return Error{fmt::format("body \"{}\" is the target or carries the camera, expected another one to be "
                                     "attached to the target",
                                     name),
                         scene.file};
        roles_.attached.push_back(*body);
    }
    return Ok{};
}

Status SceneSet::check_recipe() {
    const auto first = shared(0, 0);
    if (!first) return first.error();
    const Tracer& tracer = (*first)->tracer();
    const std::size_t target = (*first)->roles().target;
    facts_.camera = &camera();
    const BodyBounds& bounds = tracer.bounds(target);
    facts_.point_m = recipe_.point_m.value_or(bounds.centre_m);
    facts_.target_radius_m = std::max({bounds.semi_axes_m.x, bounds.semi_axes_m.y, bounds.semi_axes_m.z});
    if (scenes_[0].sun) facts_.sun_world = scenes_[0].sun->direction;
    facts_.range_m = recipe_.range_m ? recipe_.range_m : default_range_m(camera(), facts_.target_radius_m);
    keypoints_ = recipe_.keypoints_m.empty() ? chosen_keypoints(**first, recipe_.keypoints) : recipe_.keypoints_m;
    if (recipe_.phase_deg && !facts_.sun_world)
        return Error{"phase_deg of [illumination]: the scene has no [sun], expected one", recipe_.file};
    if (recipe_.gain_factor && !camera().detector)
        return Error{fmt::format("gain_factor of [exposure]: camera \"{}\" has no detector, expected one or only "
                                 "time_factor",
                                 camera().name),
                     recipe_.file};
    for (const Scene& scene : scenes_)
        if (scene.sun.has_value() != facts_.sun_world.has_value() ||
            (scene.sun && !(scene.sun->direction == *facts_.sun_world)))
            return Error{
                "a variant has another direction of the Sun, expected that of all variants: the phase angle is "
                "varied by the camera's place",
                recipe_.file};
    for (std::size_t b = 0; b < recipe_.backdrops.size(); ++b)  // before the first image, not in the middle
        if (const auto made = shared(0, b); !made) return made.error();
    return Ok{};
}

Result<std::shared_ptr<ImageScene>> SceneSet::shared(std::size_t variant, std::size_t backdrop) {
    const std::lock_guard lock(mutex_);
    auto& made = made_[{variant, backdrop}];
    if (!made) {
        auto scene = make(variant, backdrop);
        if (!scene) return scene;
        made = *scene;
    }
    return made;
}

Result<std::shared_ptr<ImageScene>> SceneSet::make(std::size_t variant, std::size_t backdrop) const {
    return ImageScene::create(scenes_[variant], roles_, recipe_.backdrops[backdrop], threads_);
}

}  // namespace narpa::dataset
