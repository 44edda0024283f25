// Tables and JSON of the ladder of budgets.
#include <fmt/format.h>

#include <array>
#include <cmath>

#include "apps/bench_ladder.h"

namespace narpa::cli {
namespace {

nlohmann::json describe(const PhaseTimes& times) {
    nlohmann::json out = nlohmann::json::object();
    for (std::size_t k = 0; k < kPhases; ++k) out[kPhaseNames[k]] = static_cast<double>(times[k]) * 1e-9;
    return out;
}

/// "rays 41 %, shading 20 %", in the order of the phases.
std::string shares(const PhaseTimes& times) {
    double sum = 0;
    for (const std::int64_t t : times) sum += static_cast<double>(t);
    std::string text;
    for (std::size_t k = 0; k < kPhases && sum > 0; ++k)
        if (times[k] > 0)
            text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", kPhaseNames[k],
                                100 * static_cast<double>(times[k]) / sum);
    return text;
}

nlohmann::json to_json(const Estimate& e) {
    return {{"value", e.value}, {"standard_error", e.standard_error}};
}

}  // namespace

void print_ratios(const CraftRatios& r) {
    const FrameCost& c = r.cost;
    const auto ms = [](double s) { return 1e3 * s; };
    say(fmt::format("craft, {} px, {:.1f} % of them covered, direct, 1 spp", c.raw.primaries,
                    100 * static_cast<double>(c.raw.hits) / static_cast<double>(c.raw.primaries)));
    say(fmt::format("  Embree's calls alone  {:>9.3f} ms   primary {:.3f}, shadow {:.3f} ({} rays)",
                    ms(c.raw.seconds()), ms(c.raw.primary_s), ms(c.raw.shadow_s), c.raw.shadow_rays));
    say(fmt::format(
        "  whole frame           {:>9.3f} ms   radiance {:.3f}, detector and conversion {:.3f}; copy {:.3f}",
        ms(c.frame_s), ms(c.radiance_s), ms(c.detector_s), ms(c.hand_over_s)));
    if (const std::string text = shares(c.phase_ns); !text.empty()) say("  radiance goes to      " + text);
    say(fmt::format("  frame / Embree        {:>9.3f}", c.to_raw()));
    say(fmt::format("  1 % / full cover      {:>9.4f}      {:.3f} / {:.3f} ms", r.space.edge_s / r.space.filled_s,
                    ms(r.space.edge_s), ms(r.space.filled_s)));
    say(fmt::format("  the same, from afar   {:>9.4f}      {:.3f} ms; Embree's calls on its rays alone {:.3f} ms",
                    r.space.far_s / r.space.filled_s, ms(r.space.far_s), ms(r.far.raw.seconds())));
    say(fmt::format("  a moved body costs    {:>9.3f} ms",
                    ms(r.still_and_moved.second_s - r.still_and_moved.first_s)));
    say(fmt::format("  load to first frame   {:>9.3f} s", r.load_s));
}

void print_ladder(const SceneLadder& l) {
    say(fmt::format(
        "{}, {} x {}, reference {} spp: mean {:.5g} W/(m^2 sr), noise {:.2g} (subtracted); detector and "
        "conversion {:.3f} ms",
        l.scene, l.width, l.height, l.reference_spp, l.ladder.level, l.ladder.reference_noise,
        1e3 * l.ladder.detector_s));
    say(fmt::format("  {:<14} {:>10} {:>10} {:>12} {:>20} {:>9} {:>10} {:>9}  {}", "budget", "ms", "CPU ms", "rays",
                    "RMSE", "bias, %", "predicted", "to loop", "where the time goes"));
    for (const Rung& r : l.ladder.rungs) {
        const auto s = r.loop ? std::nullopt : speed_up(l.ladder, r);
        // Frames without random numbers differ by nothing but what their sum rounds to.
        const double error = r.rmse.standard_error < 1e-9 * r.rmse.value ? 0 : r.rmse.standard_error;
        const std::string predicted = r.loop        ? ""
                                      : r.predicted ? fmt::format("x {:.2f}", r.predicted_to_measured())
                                                    : "unknown";
        say(fmt::format("  {:<14} {:>10.3f} {:>10.3f} {:>12.0f} {:>10.4g} +- {:<6.1g} {:>+9.3f} {:>10} {:>9}  {}",
                        r.name, 1e3 * r.median_s(), 1e3 * r.median_cpu_s(), r.rays, r.rmse.value, error,
                        100 * r.bias.value / l.ladder.level, predicted,
                        r.loop ? ""
                        : s    ? fmt::format("x {:.2f}", *s)
                               : "-",
                        shares(r.phase_ns)));
    }
    for (const bool adaptive : {true, false}) {
        const auto s = speed_ups(l.ladder, adaptive), cpu = speed_ups(l.ladder, adaptive, TimeBy::cpu);
        if (!s) continue;
        say(fmt::format(
            "  at equal error {:.2f} times as fast as the plain loop: {}, median of {} ({:.2f} to {:.2f}); "
            "by CPU time {:.2f}",
            s->median, adaptive ? "budgets in rays" : "fixed spp", s->budgets, s->least, s->most, cpu->median));
    }
}

void print_ablation(const SceneLadder& l) {
    say(fmt::format("{}, {} x {}, reference {} spp: mean {:.5g} W/(m^2 sr)", l.scene, l.width, l.height,
                    l.reference_spp, l.ladder.level));
    say(fmt::format("  {:<14} {:<20} {:>10} {:>20} {:>18} {:>9} {:>14}", "budget", "without", "CPU ms", "RMSE",
                    "bias, %", "predicted", "at equal error"));
    for (const Rung& r : l.ladder.rungs) {
        const auto cost = r.without.empty() ? std::nullopt : cost_at_equal_error(l.ladder, r);
        const double percent = 100 / l.ladder.level;
        say(fmt::format("  {:<14} {:<20} {:>10.3f} {:>10.4g} +- {:<6.1g} {:>+9.3f} +- {:<5.2g} {:>9} {:>14}",
                        r.name, r.without, 1e3 * r.median_cpu_s(), r.rmse.value, r.rmse.standard_error,
                        percent * r.bias.value, percent * r.bias.standard_error,
                        r.predicted ? fmt::format("x {:.2f}", r.predicted_to_measured()) : "unknown",
                        cost ? fmt::format("x {:.2f}", *cost) : ""));
    }
}

nlohmann::json describe(const CraftRatios& r) {
    return {{"pixels", r.cost.raw.primaries},
            {"covered", static_cast<double>(r.cost.raw.hits) / static_cast<double>(r.cost.raw.primaries)},
            {"raw",
             {{"primary_s", r.cost.raw.primary_s},
              {"shadow_s", r.cost.raw.shadow_s},
              {"shadow_rays", r.cost.raw.shadow_rays},
              {"shadowed", r.cost.raw.shadowed}}},
            {"frame_s", r.cost.frame_s},
            {"radiance_s", r.cost.radiance_s},
            {"detector_s", r.cost.detector_s},
            {"hand_over_s", r.cost.hand_over_s},
            {"phase_s", describe(r.cost.phase_ns)},
            {"frame_to_raw", r.cost.to_raw()},
            {"edge_s", r.space.edge_s},
            {"filled_s", r.space.filled_s},
            {"edge_to_filled", r.space.edge_s / r.space.filled_s},
            {"far_s", r.space.far_s},
            {"far_to_filled", r.space.far_s / r.space.filled_s},
            {"far_raw_s", r.far.raw.seconds()},
            {"still_s", r.still_and_moved.first_s},
            {"moved_s", r.still_and_moved.second_s},
            {"load_s", r.load_s}};
}

nlohmann::json describe(const SceneLadder& l) {
    nlohmann::json rungs = nlohmann::json::array();
    for (const Rung& r : l.ladder.rungs) {
        nlohmann::json rung{{"name", r.name},           {"loop", r.loop},       {"adaptive", r.adaptive},
                            {"median_s", r.median_s()}, {"seconds", r.seconds}, {"cpu_seconds", r.cpu_seconds},
                            {"rays", r.rays},           {"samples", r.samples}, {"rmse", to_json(r.rmse)},
                            {"bias", to_json(r.bias)}};
        if (!r.loop) {
            rung["step"] = kStepNames[static_cast<std::size_t>(r.step)];
            rung["predicted"] = r.predicted ? nlohmann::json(*r.predicted) : nlohmann::json(nullptr);
            rung["phase_s"] = describe(r.phase_ns);
            if (const auto s = speed_up(l.ladder, r)) rung["speed_up"] = *s;
            if (!r.without.empty()) {
                rung["without"] = r.without;
                if (const auto cost = cost_at_equal_error(l.ladder, r)) rung["cost_at_equal_error"] = *cost;
            }
        }
        rungs.push_back(std::move(rung));
    }
    nlohmann::json out{
        {"scene", l.scene},
        {"width", l.width},
        {"height", l.height},
        {"reference",
         {{"spp", l.reference_spp}, {"mean", l.ladder.level}, {"noise_rms", l.ladder.reference_noise}}},
        {"detector_s", l.ladder.detector_s},
        {"rungs", std::move(rungs)}};
    for (const bool adaptive : {true, false}) {
        const auto s = speed_ups(l.ladder, adaptive), cpu = speed_ups(l.ladder, adaptive, TimeBy::cpu);
        if (!s) continue;
        out["speed_up"][adaptive ? "rays" : "spp"] = {{"median", s->median},
                                                      {"least", s->least},
                                                      {"most", s->most},
                                                      {"budgets", s->budgets},
                                                      {"median_by_cpu", cpu->median}};
    }
    return out;
}

}  // namespace narpa::cli
