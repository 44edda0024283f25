/// renderer/integrator/frame_settings.h - how a frame is rendered.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "renderer/integrator/frame_budget.h"
#include "renderer/integrator/mechanisms.h"
#include "renderer/scene/scene.h"

namespace narpa {

struct FrameSettings {
    int spp = 1;             ///< 1: the ray through each pixel's centre
    std::uint64_t seed = 0;  ///< scene seed; samples depend on (seed, frame, pixel, sample) and nothing else
    std::uint32_t frame = 0;
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;                                ///< of method path
    std::atomic<std::size_t>* pixels_done = nullptr;  ///< counted up while the frame is rendered; may be null
    FrameBudget budget{};                             ///< kind samples: spp
    bool times = false;                               ///< measure where the time goes: FrameAccount::phase_ns
    Mechanisms mechanisms{};
};

}  // namespace narpa
