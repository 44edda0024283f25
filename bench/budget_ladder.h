/// bench/budget_ladder.h - time and error of one camera's frames at several budgets, beside those of the plain loop
/// of reference_loop.h and of the renderer with one mechanism switched off, in one run.
///
/// Errors are against a reference of many samples whose own noise is subtracted (convergence.h), W m^-2 sr^-1. All
/// candidates take turns, so that other load on the machine affects all alike.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/convergence.h"
#include "bench/embree/reference_loop.h"
#include "emulator/threads.h"
#include "emulator/world.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Names of a frame's phases in table and JSON.
inline constexpr std::array<const char*, kPhases> kPhaseNames{"aim",         "rays",     "shading",
                                                              "shadow_rays", "indirect", "passes"};

/// Number of images whose mean is the reference; their scatter gives its noise.
inline constexpr int kReferenceImages = 16;

struct LadderSettings {
    std::vector<int> spp{1, 4, 16};
    std::vector<double> rays_per_pixel{2, 4, 8, 16};  ///< as FrameBudget::rays
    std::vector<int> loop_spp{1, 4, 16, 64, 256};     ///< of the plain loop, where there is one
    bool ablation = false;     ///< kMechanisms switched off one at a time, at the middle one of the budgets
    int frames = 9;            ///< at each budget, each with random numbers of its own; >= 2
    int reference_spp = 4096;  ///< in kReferenceImages
    std::int64_t t_ns = 0;     ///< the moment that the scene shows
    bool bands = false;        ///< errors of each band, instead of the mean of the three
};

/// The mechanisms that an ablation switches off.
struct NamedMechanism {
    const char* name;
    bool Mechanisms::*on;
};
inline constexpr std::array<NamedMechanism, 6> kMechanisms{
    {{"sample plan", &Mechanisms::sample_plan},
     {"edge classes", &Mechanisms::edge_classes},
     {"path reuse", &Mechanisms::path_reuse},
     {"small-body sampling", &Mechanisms::small_body_sampling},
     {"separate sun", &Mechanisms::separate_sun},
     {"tile culling", &Mechanisms::tile_culling}}};

/// One budget, or one number of samples of the plain loop.
struct Rung : ErrorRow {
    std::string name;
    std::string without;  ///< the mechanism that is off; empty: none
    bool loop = false, adaptive = false;
    std::vector<double> seconds;          ///< of each frame's radiance
    std::vector<double> cpu_seconds;      ///< the same, summed over the threads; least sensitive to other load
    double rays = 0, samples = 0;         ///< a frame, mean
    FrameStep step = FrameStep::refined;  ///< the coarsest of all frames
    std::optional<double> predicted;      ///< the frames' own standard error, RMS; none: a frame has no estimate
    PhaseTimes phase_ns{};                ///< a frame, mean, of all threads

    [[nodiscard]] double median_s() const;
    [[nodiscard]] double median_cpu_s() const;
    /// Frames that leave out indirect light cannot estimate their error.
    [[nodiscard]] bool estimates_error() const { return is_worse(FrameStep::no_indirect, step); }
    [[nodiscard]] double predicted_to_measured() const { return predicted.value_or(0) / rmse.value; }
};

struct Ladder {
    double level = 0, reference_noise = 0;  ///< of the reference, W m^-2 sr^-1
    double detector_s = 0;                  ///< detector and conversion of a frame, median
    std::vector<Rung> rungs;
    double reference_s = 0;  ///< time of the reference
};

/// `loop`: empty where it cannot render the scene. `progress` is called with a line of text.
[[nodiscard]] Ladder measure_ladder(const World& world, std::size_t camera, const LadderSettings& settings,
                                    const ReferenceLoop& loop, TracingThreads& threads,
                                    const std::function<void(const std::string&)>& progress);

/// Wall time, or CPU time of all threads.
enum class TimeBy : std::uint8_t { wall, cpu };

/// Time of the plain loop to the error of this rung, over that of the rung: by linear interpolation between the
/// loop's rungs in the logarithms of time and error. None where its errors do not enclose the rung's.
[[nodiscard]] std::optional<double> speed_up(const Ladder& ladder, const Rung& rung, TimeBy by = TimeBy::wall);
/// CPU time of a rung without some mechanism over that of the full renderer to the same error, extrapolated beyond
/// its rungs. Above 1: the mechanism saves time.
[[nodiscard]] std::optional<double> cost_at_equal_error(const Ladder& ladder, const Rung& rung);

/// Speed-ups over the budgets that have one, except those whose frames left something out.
struct SpeedUps {
    double median = 0, least = 0, most = 0;
    std::size_t budgets = 0;
};
/// For the budgets in rays (adaptive), or for the fixed numbers of samples.
[[nodiscard]] std::optional<SpeedUps> speed_ups(const Ladder& ladder, bool adaptive, TimeBy by = TimeBy::wall,
                                                double rays_min = 0);  ///< of frames with so many rays at least

}  // namespace narpa
