/// apps/scene_options.h - options that several commands share: budgets, poses of bodies, how poses are estimated.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/cli.h"
#include "emulator/world.h"
#include "renderer/trajectory/trajectory.h"
#include "tracking/frame_tracker.h"

namespace narpa::cli {

/// --spp, --budget-ms, --budget-rays: one of them, in place of the scene's.
struct BudgetOptions {
    std::optional<int> spp;
    std::optional<double> budget_ms;
    std::optional<std::uint64_t> budget_rays;

    void add_to(Parser app);
    void override_scene(RenderSettings& render) const;
};

/// --trajectory and --pose: where bodies are in a single image or scan.
struct PoseOptions {
    std::string trajectory;
    std::vector<std::string> poses;

    void add_to(Parser app);
    /// Apply --pose to the scene, before the world is made, and --trajectory to the world.
    [[nodiscard]] Status place(Scene& scene) const;
    [[nodiscard]] Status load(World& world, std::int64_t t_from_ns, std::int64_t t_to_ns) const;
    /// The rows of --trajectory, without bodies that --pose has placed; none without it.
    [[nodiscard]] Result<std::vector<TrajectoryRow>> rows() const;
    /// Warns of bodies without a pose in the rows at a time between these two, and places the others.
    [[nodiscard]] Status load(World& world, const std::vector<TrajectoryRow>& rows, std::int64_t t_from_ns,
                              std::int64_t t_to_ns) const;
};

/// Parses NAME=VALUE pairs, separated by commas. Names: those of kModelErrors, and `distortion` where that pointer
/// is not null. `option`: name of the option, for messages.
Result<ModelUncertainty> model_uncertainty(const std::string& text, const std::string& option,
                                           double* distortion = nullptr);

/// Settings of pose estimation: options of `estimate` and of `run --estimate`.
struct TrackerFlags {
    std::string method{camera_methods().front().name};
    std::string start = "2,2";
    std::string uncertainty;
    std::string dashes = "--";  ///< before the options' names
    TrackerOptions tracker;

    /// Adds the options, with `prefix` before each name: --target, or --estimate-target.
    void add_to(Parser app, const std::string& prefix);
    [[nodiscard]] Result<TrackerOptions> options() const;
};

}  // namespace narpa::cli
