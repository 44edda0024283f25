/// apps/device_options.h - the bus and the sinks of `narpa run` and `narpa check`.
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

}  // namespace narpa::cli
