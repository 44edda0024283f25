/// bench/ratios.h - the few ratios that say whether frames are as fast as they can be, each of times that
/// took turns in one run: of medians.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "bench/raw_embree.h"
#include "emulator/threads.h"
#include "emulator/world.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Medians, seconds.
struct FrameCost {
    double frame_s = 0;  ///< from poses to bytes: radiance, detector, conversion
    double radiance_s = 0, detector_s = 0, hand_over_s = 0;  ///< hand-over: one copy of the bytes
    PhaseTimes phase_ns{};                                   ///< of one frame, all threads
    RawCost raw;                                             ///< seconds: medians
    [[nodiscard]] double to_raw() const { return frame_s / raw.seconds(); }
};

/// One sample a pixel by direct light, beside Embree's calls on the same rays. An Error where not all is triangles.
[[nodiscard]] Result<FrameCost> frame_against_raw(const World& world, std::size_t camera, int rounds,
                                                  TracingThreads& threads);

/// Medians, seconds.
struct TwoFrames {
    double first_s = 0, second_s = 0;
};
/// Frames of several cameras, in their order.
[[nodiscard]] std::vector<double> frames_of(const World& world, std::span<const std::size_t> cameras, int rounds,
                                            TracingThreads& threads);
/// Frames of one camera with all bodies at rest, and with each of them somewhere else (by 0.1 mm and 0.01 mrad, so
/// that it shows the same) in every frame.
[[nodiscard]] TwoFrames still_and_moved(const World& world, std::size_t camera, int rounds,
                                        TracingThreads& threads);

/// From the name of the file to the first frame's bytes. `load` reads the scene as the bench has it.
[[nodiscard]] Result<double> load_to_first_frame(const std::function<Result<Scene>()>& load, std::size_t camera,
                                                 int rounds, TracingThreads& threads);

}  // namespace narpa
