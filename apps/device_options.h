/// apps/device_options.h - the bus, the sinks and the MCAP file of commands that run the emulator.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/options.h"
#include "base/result.h"

namespace narpa::cli {

struct DeviceOptions {
    std::string bus;
    std::vector<std::string> video_texts, lidar_texts;  ///< as given

    /// --can, --video, --lidar.
    void add_to(Parser command);

    using Outputs = std::vector<std::pair<std::string, std::string>>;  ///< sensor, sink
    [[nodiscard]] Result<Outputs> video() const;
    [[nodiscard]] Result<Outputs> lidar() const;
};

/// --mcap. `file`: empty where it is not given.
Option add_mcap_to(Parser command, std::string& file);

}  // namespace narpa::cli
