/// rehearsal/navigation/sensor_inputs.h - opens the sources of frames and packets that the scenario navigates by.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/lidar/packet_source.h"
#include "drivers/video/video_source.h"
#include "rehearsal/navigation/node.h"
#include "rehearsal/navigation/scene_model.h"
#include "rehearsal/navigation/sweep_buffer.h"

namespace narpa::rehearsal {

struct CameraInput {
    std::size_t camera = 0;  ///< index in the scene
    std::unique_ptr<VideoSource> source;
    std::size_t frame_bytes = 0;
};

struct LidarInput {
    std::unique_ptr<PacketSource> source;
    SweepBuffer buffer;
};

struct SensorInputs {
    std::vector<CameraInput> cameras;  ///< in the order of the scenario's
    std::vector<LidarInput> lidars;
};

/// Errors: a source for a sensor that the scenario does not navigate by, a sensor without a source or with two, the
/// drivers'.
Result<SensorInputs> open_sensor_inputs(const Scenario& scenario, const SceneModel& model, const SourceList& video,
                                        const SourceList& lidar);

}  // namespace narpa::rehearsal
