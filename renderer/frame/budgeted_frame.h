/// renderer/frame/budgeted_frame.h - renders one frame within a budget of time or rays by choosing its passes.
#pragma once

#include "renderer/frame/frame_passes.h"
#include "renderer/frame/pass_costs.h"

namespace narpa {

/// Renders the frame; its budget is of any kind but `samples`. `variance` may be null.
FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
