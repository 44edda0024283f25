/// renderer/film/budgeted_frame.h - one frame within a budget: which passes it has time or rays for.
#pragma once

#include "renderer/film/frame_passes.h"
#include "renderer/film/pass_costs.h"

namespace narpa {

/// Makes the frame; its settings' budget is of any kind but `samples`. `variance` may be null.
FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
