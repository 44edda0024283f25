/// apps/budget_options.h - --spp, --budget-ms, --budget-rays: one of them, in place of what the scene says.
#pragma once

#include <cstdint>
#include <optional>

#include "apps/options.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

struct BudgetOptions {
    std::optional<int> spp;
    std::optional<double> budget_ms;
    std::optional<std::uint64_t> budget_rays;

    void add_to(Parser app);
    void override_scene(RenderSettings& render) const;
};

}  // namespace narpa::cli
