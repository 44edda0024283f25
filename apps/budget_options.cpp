#include "apps/budget_options.h"

#include <cmath>

namespace narpa::cli {

void BudgetOptions::add_to(Parser app) {
    const Option samples = app.option("--spp", spp, "Samples per pixel instead of the scene's").range(1, 65535);
    const Option time =
        app.option("--budget-ms", budget_ms, "Time budget per frame in milliseconds, instead").range(0.001, 1e6);
    const Option rays = app.option("--budget-rays", budget_rays, "Budget per frame in rays, instead")
                            .range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000});
    samples.excludes(time).excludes(rays);
    time.excludes(rays);
}

void BudgetOptions::override_scene(RenderSettings& render) const {
    if (!spp && !budget_ms && !budget_rays) return;
    render.spp = spp.value_or(render.spp);
    render.budget_ns = budget_ms ? std::llround(*budget_ms * 1e6) : 0;
    render.budget_rays = budget_rays.value_or(0);
}

}  // namespace narpa::cli
