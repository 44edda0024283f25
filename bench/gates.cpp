#include "bench/gates.h"

#include <fmt/format.h>

namespace narpa {
namespace {

/// None: no fault.
std::optional<std::string> prediction_fault(const Rung& rung) {
    if (rung.rmse.value <= 0)
        return "its error does not stand out from the reference's noise: take a better reference";
    if (!rung.predicted)
        return rung.estimates_error() ? std::optional<std::string>("its frames have no error estimate")
                                      : std::nullopt;
    if (rung.predicted_to_measured() >= kPredictedLeast && rung.predicted_to_measured() <= kPredictedMost)
        return {};
    return fmt::format("the predicted error is {:.2f} of the measured, expected {} to {}",
                       rung.predicted_to_measured(), kPredictedLeast, kPredictedMost);
}

std::optional<std::string> speed_fault(const SceneLadder& scene) {
    if (scene.speed_up_least <= 0) return {};
    constexpr double kUsed = 0.9;  // a budget is not used up to the last ray
    const double rays_least = kUsed * scene.speed_up_from * scene.width * scene.height;
    const auto s = speed_ups(scene.ladder, true, TimeBy::wall, rays_least);
    if (!s) return "no budget's error lies between those of the plain loop";
    if (s->median >= scene.speed_up_least) return {};
    return fmt::format(
        "{:.2f} times as fast as the plain loop at equal error{}, expected {:g} or more", s->median,
        scene.speed_up_from > 0 ? fmt::format(" from {:g} rays a pixel on", scene.speed_up_from) : "",
        scene.speed_up_least);
}

}  // namespace

std::vector<std::string> bench_faults(const SceneLadder& scene) {
    std::vector<std::string> faults;
    for (const Rung& rung : scene.ladder.rungs)
        if (!rung.loop)
            if (const auto fault = prediction_fault(rung))
                faults.push_back(fmt::format("{}, {}: {}", scene.scene, rung.name, *fault));
    if (const auto fault = speed_fault(scene)) faults.push_back(scene.scene + ": " + *fault);
    return faults;
}

std::vector<std::string> bench_faults(const CraftRatios& r) {
    std::vector<std::string> faults;
    const auto at_most = [&](const char* what, double value, double bound, const char* unit) {
        if (!(value <= bound))
            faults.push_back(fmt::format("{}: {:.4g}{}, expected at most {:g}{}", what, value, unit, bound, unit));
    };
    at_most("a frame to Embree's calls on its rays", r.cost.to_raw(), kToRawMost, "");
    at_most("1 % cover to full cover", r.space.edge_s / r.space.filled_s, kEdgeMost, "");
    at_most("what a moved body costs", 1e3 * (r.still_and_moved.second_s - r.still_and_moved.first_s),
            1e3 * kMovedMost_s, " ms");
    at_most("load to first frame", r.load_s, kLoadMost_s, " s");
    return faults;
}

}  // namespace narpa
