/// bench/budget_ladder.h - what a budget buys: time and error of one camera's frames at several budgets,
/// beside those of the plain loop of reference_loop.h, in one run.
///
/// Errors are those of the mean of the three bands, W m^-2 sr^-1, against a reference of many samples whose own
/// noise is taken out (convergence.h). Budgets and loop take turns, so that whatever else the machine does hits all
/// alike.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/convergence.h"
#include "bench/reference_loop.h"
#include "emulator/threads.h"
#include "emulator/world.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Of a frame's phases, as table, JSON and plot call them.
inline constexpr std::array<const char*, kPhases> kPhaseNames{"aim",         "rays",     "shading",
                                                              "shadow_rays", "indirect", "passes"};

struct LadderSettings {
    std::vector<int> spp{1, 4, 16};
    std::vector<double> rays_per_pixel{2, 4, 8, 16};  ///< as FrameBudget::rays
    std::vector<int> loop_spp{1, 4, 16, 64, 256};     ///< of the plain loop, where there is one
    int frames = 9;                                   ///< at each budget, each with random numbers of its own; >= 2
    int reference_spp = 4096;                         ///< in sixteen pictures
    std::int64_t t_ns = 0;                            ///< what the scene shows
};

/// One budget, or one number of samples of the plain loop.
struct Rung {
    std::string name;
    bool loop = false, adaptive = false;
    std::vector<double> seconds;          ///< of each frame's radiance
    std::vector<double> cpu_seconds;      ///< the same, summed over the threads: what other load disturbs least
    double rays = 0, samples = 0;         ///< a frame, mean
    FrameStep step = FrameStep::refined;  ///< of the frame that got least far
    Estimate rmse, bias;
    std::optional<double> predicted;  ///< the frames' own standard error, RMS; none: a frame did not tell
    PhaseTimes phase_ns{};            ///< a frame, mean, of all threads

    [[nodiscard]] double median_s() const;
    [[nodiscard]] double median_cpu_s() const;
    /// Frames that leave out indirect light or pixels cannot know what that costs.
    [[nodiscard]] bool knows_its_error() const { return step <= FrameStep::one_sample; }
    /// What the frames say of their error, in parts of what it is.
    [[nodiscard]] double honesty() const { return predicted.value_or(0) / rmse.value; }
};

struct Ladder {
    double level = 0, reference_noise = 0;  ///< of the reference, W m^-2 sr^-1
    double detector_s = 0;                  ///< detector and conversion of a frame, median
    std::vector<Rung> rungs;
};

double median(std::vector<double> values);

/// `loop`: null where the scene is beyond it. `tell` hears how far it is.
[[nodiscard]] Ladder climb(const World& world, std::size_t camera, const LadderSettings& settings,
                           const ReferenceLoop* loop, TracingThreads& threads,
                           const std::function<void(const std::string&)>& tell);

/// By the clock on the wall, or by the time that the threads computed.
enum class TimeBy : std::uint8_t { wall, cpu };

/// How long the plain loop takes to the error of this rung, in parts of what the rung takes: along straight lines
/// between the loop's rungs in the logarithms of time and error. None where its errors do not enclose it.
[[nodiscard]] std::optional<double> speed_up(const Ladder& ladder, const Rung& rung, TimeBy by = TimeBy::wall);

/// Over the budgets that have one, but for those whose frames left something out.
struct SpeedUps {
    double median = 0, least = 0, most = 0;
    std::size_t budgets = 0;
};
/// Of the budgets in rays (adaptive), or of the fixed numbers of samples.
[[nodiscard]] std::optional<SpeedUps> speed_ups(const Ladder& ladder, bool adaptive, TimeBy by = TimeBy::wall,
                                                double rays_least = 0);  ///< of frames with so many rays at least

}  // namespace narpa
