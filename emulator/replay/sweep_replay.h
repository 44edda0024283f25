/// emulator/replay/sweep_replay.h - makes the sweeps of a logged run again.
///
/// A log has no packets. They follow from the scene, the seed and the poses, which the log's CAN bus commands, as
/// in lockstep: each packet is fired once all bodies have commands up to its end. Where the run had the LiDAR, the
/// packets of a run in lockstep repeat bit for bit; in real time a command may have come too late for a packet.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "drivers/can/can_bus.h"
#include "emulator/bus/can_node.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/sweep_log.h"
#include "emulator/world.h"

namespace narpa {

/// A whole turn of a spinning LiDAR, or a frame of another.
struct ReplayedSweep {
    struct Packet {
        std::int64_t t_ns = 0;  ///< of its first shot
        std::vector<std::uint8_t> bytes;
    };
    std::int64_t sweep = 0;               ///< as SweepLedger::sweep
    std::int64_t t_ns = 0, t_end_ns = 0;  ///< when the first packet starts and the last is complete
    std::vector<Packet> packets;          ///< data packets
    std::optional<bool> repeats;          ///< the run's own packets; empty: the log has no such sweep
    int line = 0;                         ///< of the log's row
};

class SweepReplay {
public:
    /// `lidar` empty: the first of the scene. `scene_file` empty: the run's own. Errors: those of the log's files;
    /// no record of when the run ended.
    static Result<std::unique_ptr<SweepReplay>> open(const std::string& folder, const std::string& lidar,
                                                     const std::string& scene_file);

    [[nodiscard]] const World& world() const noexcept { return *world_; }
    [[nodiscard]] const Lidar& lidar() const noexcept { return unit_.lidar(); }
    [[nodiscard]] std::size_t lidar_index() const noexcept { return index_; }
    /// LIDAR.sweeps.csv; it may not exist.
    [[nodiscard]] const std::string& log_file() const noexcept { return log_file_; }
    /// The log's sweeps were sent as soon as complete, as only a run in lockstep does.
    [[nodiscard]] bool is_lockstep() const noexcept { return is_lockstep_; }

    /// Makes the next whole sweep, after leaving out `skip` of them. False: the run has ended. Afterwards all
    /// bodies have poses from the sweep's begin to its end.
    bool next(std::size_t skip, ReplayedSweep& out);

private:
    SweepReplay(std::unique_ptr<World> world, std::size_t lidar);
    Status open_bus(const std::string& folder);
    /// Reads commands until bodies have poses up to this time. False: the run ended before.
    bool advance_to(std::int64_t t_ns);
    void fire(std::int64_t first, std::int64_t end, ReplayedSweep& out);

    std::unique_ptr<World> world_;
    std::size_t index_;
    LidarUnit unit_;
    std::unique_ptr<CanBus> bus_;
    std::unique_ptr<CanNode> can_;  ///< null: no body is commanded
    std::int64_t end_ns_ = 0;       ///< of a run without commands
    std::int64_t t_ns_ = 0, next_ = -1;
    std::string log_file_;
    std::vector<LoggedSweep> logged_;
    bool is_lockstep_ = false;
};

}  // namespace narpa
