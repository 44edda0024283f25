/// apps/estimate_one.h - `narpa estimate` of a single frame or sweep that lies in a file.
#pragma once

#include "apps/cli.h"
#include "apps/pose_options.h"
#include "emulator/frame_tracker.h"
#include "estimator/cloud/range_points.h"

namespace narpa::cli {

struct OneOptions {
    std::string scene, sensor;  ///< the sensor's name; empty: the first
    std::string frame, sweep;   ///< FILE.raw: the device's bytes; FILE.pcap
    double time_s = 0;
    double range_noise_m = RangeNoise{}.range_m;  ///< of the sweep, standard deviation
    PoseOptions pose;
    TrackerOptions tracker;
    int threads = 0;
};

/// The truth is where scene, trajectory and --pose have the bodies at that time; the guess lies off it.
Outcome estimate_frame(const OneOptions& options);
Outcome estimate_sweep(const OneOptions& options);

}  // namespace narpa::cli
