/// apps/commands/sweep_file.h - one turn of a LiDAR out of a capture.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "estimator/cloud/range_points.h"
#include "protocols/captured_datagrams.h"

namespace narpa::cli {

struct CapturedSweep {
    LidarSweep sweep;  ///< times count from its first shot
    CaptureCounters capture;
    std::string cut;                                  ///< as Capture
    std::uint64_t used = 0, later = 0;                ///< data packets of the turn; of other turns
    std::map<std::string, std::uint64_t> refused;     ///< datagrams of the right size, by reason
    std::map<std::string, std::uint64_t> other_size;  ///< datagrams by port and size
    std::map<std::string, std::uint64_t> other_unit;  ///< data packets by unit
    std::vector<std::string> warnings;                ///< what was dropped that a good capture would not hold
};

/// One turn from the earliest of the unit's packets on, in the order of their own times, whatever that in the file.
/// `chosen`: ADDRESS or ADDRESS:PORT of the unit; empty: there is one. Errors: no capture, no data packet of
/// `unit`, several units.
[[nodiscard]] Result<CapturedSweep> read_sweep(const std::string& path, const LidarModel& unit,
                                               const std::string& chosen);

/// All counts.
[[nodiscard]] nlohmann::json to_json(const CapturedSweep& sweep);

}  // namespace narpa::cli
