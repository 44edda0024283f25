/// emulator/run_options.h - what a run of the emulator is made of, beside its scene.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "emulator/frame_observer.h"

namespace narpa {

class LidarUnit;

struct RunOptions {
    std::string bus;                                                ///< BUS; empty: no commands
    std::vector<std::pair<std::string, std::string>> video, lidar;  ///< sensor name and SINK; a name may repeat
    std::vector<std::string> triggers{};  ///< SOURCE of pulses for cameras in trigger mode external; needs a bus
    std::string second_pulses{};          ///< LINE for one pulse per second; empty: none
    bool lockstep = false;
    double duration_s = 0;   ///< of simulation time; 0: until stopped or until a recorded bus ends
    std::string log_folder;  ///< empty: no log
    std::string mcap{};      ///< MCAP file; empty: none
    bool log_shots = false;  ///< logs the truth of every LiDAR shot too, at the cost of a second ray for each
    std::optional<double> late_max{};  ///< part of a camera's frames that may be late or skipped; empty: any
    int threads = 0;                   ///< tracing threads; 0: one per core, or one per entry of `cpus`
    std::vector<int> cpus;             ///< processors that tracing threads are bound to in real time; empty: any
    std::vector<OpenFrameObserver> observers{};  ///< of names that differ; several may share a camera
    /// In lockstep, of each packet that a LiDAR has just fired, which then also computes the truth of its shots;
    /// from the loop, which waits.
    std::function<void(const LidarUnit& unit, std::int64_t packet)> on_packet{};
    std::function<void(const std::string&)> on_refusal{};  ///< once, when CanNode::refuses_poses, during the run
};

}  // namespace narpa
