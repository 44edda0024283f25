/// dataset/scene/scene_set.h - the scenes of a recipe: one for each of its variants, read once.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "dataset/recipe/recipe.h"
#include "dataset/scene/image_scene.h"

namespace narpa::dataset {

class SceneSet {
public:
    /// Reads the scenes, finds camera and bodies by their names and checks the recipe against them. `threads`: as
    /// those of RenderScene::create. Errors: those of the scenes; a name that a scene does not have; variants with
    /// other bodies or another size of the image; a factor for what the scene does not have.
    static Result<std::unique_ptr<SceneSet>> create(const Recipe& recipe, int threads);

    [[nodiscard]] const Recipe& recipe() const { return recipe_; }
    [[nodiscard]] const SceneFacts& facts() const { return facts_; }
    [[nodiscard]] const Scene& scene(std::size_t variant) const { return scenes_[variant]; }
    [[nodiscard]] const Camera& camera() const { return scenes_[0].cameras[roles_.camera]; }
    /// Target axes, metres.
    [[nodiscard]] const std::vector<Vec3>& keypoints() const { return keypoints_; }
    /// FNV-1a of all files that the scenes were read from, in hexadecimal digits.
    [[nodiscard]] const std::string& fingerprint() const { return fingerprint_; }
    /// Sentences about the scenes and what of them a data set does not use.
    [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

    /// The scene of a variant and a background, by their indices in the recipe: made at its first use, then shared.
    /// Thread-safe.
    [[nodiscard]] Result<std::shared_ptr<ImageScene>> shared(std::size_t variant, std::size_t backdrop);
    /// The same of one's own, whose albedo may be changed.
    [[nodiscard]] Result<std::shared_ptr<ImageScene>> make(std::size_t variant, std::size_t backdrop) const;

private:
    explicit SceneSet(const Recipe& recipe, int threads) : recipe_(recipe), threads_(threads) {}
    Status read();
    Status check_variants() const;
    Status find_roles();
    Status check_recipe();

    const Recipe recipe_;
    const int threads_;
    std::vector<Scene> scenes_;  ///< by variant
    Roles roles_;
    SceneFacts facts_;
    std::vector<Vec3> keypoints_;
    std::string fingerprint_;
    std::vector<std::string> warnings_;
    std::mutex mutex_;
    std::map<std::pair<std::size_t, std::size_t>, std::shared_ptr<ImageScene>> made_;  ///< guarded by mutex_
};

}  // namespace narpa::dataset
