/// rehearsal/navigation/navigation_log.h - output files of the navigation: navigation.csv (a line per control
/// period), measurements.csv (a line per frame or sweep), camera pictures at the start of each hold and at contact,
/// navigation.json (counts). frame() may be called from another thread than the rest.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "rehearsal/navigation/autopilot.h"

namespace narpa::rehearsal {

/// Traffic on the inputs and the bus.
struct NodeCounts {
    std::uint64_t cycles = 0, cycles_late = 0;  ///< late: started more than a tenth of a period late
    std::uint64_t cycles_passed_over = 0;
    std::uint64_t frames = 0, frames_missing = 0;  ///< read; announced on the bus but not received
    std::uint64_t packets = 0, packets_bad = 0, turns_incomplete = 0;
    std::uint64_t bad_messages = 0, send_drops = 0;
};

class NavigationLog {
public:
    /// Creates the folder. Errors: it cannot be written to.
    static Result<std::unique_ptr<NavigationLog>> create(const std::string& folder, const Scenario& scenario);

    /// Keeps the newest frame of this camera.
    void frame(const Camera& camera, std::span<const std::uint8_t> bytes);
    void cycle(const CycleRecord& record);
    Status finish(const NodeCounts& counts, std::uint64_t restarts, const std::string& version);

private:
    NavigationLog() = default;
    void pictures(const std::string& name);

    struct LastFrame {
        Camera camera;
        std::vector<std::uint8_t> bytes;
    };
    std::string folder_;
    std::vector<std::string> legs_;
    std::ofstream cycles_, measurements_;
    std::mutex mutex_;  ///< guards seen_
    std::map<std::string, LastFrame> seen_;
    std::map<std::string, std::array<std::uint64_t, kMeasurementOutcomes.size()>> outcomes_;
    GuidancePhase phase_ = GuidancePhase::moving;
    AbortReason abort_ = AbortReason::none;
    Status pictures_written_{Ok{}};
};

}  // namespace narpa::rehearsal
