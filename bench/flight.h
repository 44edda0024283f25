/// bench/flight.h - a trajectory flown there and back while the real-time loop runs, and its frames by range.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "emulator/frame_observer.h"
#include "renderer/scene/scene.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa {

/// The rows, sorted by time from 0 on, then the same in reverse with reversed velocities.
[[nodiscard]] std::vector<TrajectoryRow> there_and_back(std::vector<TrajectoryRow> rows);
/// A flight that begins at 0 and ends where it began, flown again until this time.
[[nodiscard]] std::vector<TrajectoryRow> repeated(std::vector<TrajectoryRow> flight, std::int64_t until_ns);

/// A recorded bus in memory with the pose commands of a trajectory, each a tenth of a second before its time.
class RecordedFlight {
public:
    /// Errors: a body that the scene does not have or does not command, a pose that cannot be encoded.
    static Result<RecordedFlight> create(const Scene& scene, const std::string& path,
                                         const std::vector<TrajectoryRow>& rows);
    RecordedFlight(RecordedFlight&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    RecordedFlight& operator=(RecordedFlight&&) = delete;
    ~RecordedFlight();

    /// For RunOptions::bus.
    [[nodiscard]] std::string bus() const;

private:
    explicit RecordedFlight(int fd) : fd_(fd) {}
    int fd_;
};

/// One frame of a flight.
struct FlownFrame {
    double range_m = 0;  ///< from the camera to the nearest origin of a body that does not carry it
    bool late = false;
    std::uint8_t step = 0;  ///< index into kStepNames
    double hand_over_ms = 0, samples_per_pixel = 0, expected_error = 0;
};
using Flown = std::vector<FlownFrame>;

/// Adds each handed-over frame of the `camera`th camera that runs to `out`. Frames that come while it is busy are
/// left out.
[[nodiscard]] OpenFrameObserver watch_flight(std::size_t camera, std::shared_ptr<Flown> out);

/// By range in octaves, the farthest first.
[[nodiscard]] nlohmann::json by_range(const Flown& frames);
[[nodiscard]] std::string by_range_text(const Flown& frames);

}  // namespace narpa
