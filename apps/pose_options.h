/// apps/pose_options.h - --time, --trajectory and --pose: where bodies are in a single picture or scan.
#pragma once

#include <string>
#include <vector>

#include "apps/cli.h"
#include "emulator/world.h"

namespace narpa::cli {

struct PoseOptions {
    std::string trajectory;
    std::vector<std::string> poses;

    void add_to(Parser app);
    /// --pose: before the world is made. --trajectory: after.
    [[nodiscard]] Status place(Scene& scene) const;
    [[nodiscard]] Status load(World& world, std::int64_t t_from_ns, std::int64_t t_to_ns) const;
};

}  // namespace narpa::cli
