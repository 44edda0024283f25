/// apps/scene_argument.h - the scene of a command: its file or name, and the keys that --set changes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/options.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

struct SceneArgument {
    std::string file;               ///< or a name that `narpa list` shows; empty: not given
    std::vector<std::string> sets;  ///< KEY=VALUE (renderer/keys/toml_override.h)

    /// Adds SCENE, which is required, --set and --strict.
    void add_to(Parser app);
    /// Adds --set and --strict.
    void add_settings_to(Parser app);
    static Option add_set_to(Parser app, std::vector<std::string>& sets);
    /// Reads the scene, with another method than its own if one is given, and prints its warnings; with --strict
    /// they are an Error.
    [[nodiscard]] Result<Scene> load(std::optional<RenderSettings::Method> method = {}) const;
    /// The same, without that Error: for commands that have more to check.
    [[nodiscard]] Result<Scene> load_anyway(std::optional<RenderSettings::Method> method = {}) const;
};

}  // namespace narpa::cli
