/// emulator/log/sweep_log.h - what `run --log` writes of a LiDAR: LIDAR.sweeps.csv, a row for each sweep, and on
/// request LIDAR.shots.csv, a row for each shot.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "emulator/clock.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/row_log.h"

namespace narpa {

/// One turn or frame of a LiDAR. Times are of the simulation clock. A packet belongs to the sweep in which it
/// starts.
struct SweepLedger {
    std::int64_t sweep = 0;  ///< whole turns since simulation time 0
    std::uint64_t packets = 0;
    std::uint64_t late = 0;     ///< of these: sent after the next one was complete
    std::uint64_t skipped = 0;  ///< packets that were not made after these, because the sensor was too far behind
    std::uint64_t shots = 0, returns = 0;
    std::int64_t t_first_shot_ns = 0, t_last_shot_ns = 0;
    std::int64_t t_complete_ns = 0, t_hand_over_ns = 0;  ///< of the last packet: when it was due; when it was sent
    std::int64_t hand_over_max_ns = 0;                   ///< the longest from due to sent of any packet
    std::uint32_t packets_crc32 = 0;                     ///< of all bytes of the data packets, as of image_crc32()
    std::int64_t utc_offset_ns = 0, utc_error_ns = -1;   ///< FrameLedger, when the last packet was sent
    std::uint64_t lost = 0;                              ///< datagrams that sinks or local receivers dropped
};

/// The names of the columns of LIDAR.sweeps.csv, with the line end; `lost` is the last, as it alone is not a
/// function of commands and seed in lockstep.
inline constexpr std::string_view kSweepHeader =
    "sweep,t_first_shot_ns,t_last_shot_ns,packets,packets_late,packets_skipped,shots,returns,t_complete_ns,"
    "t_hand_over_ns,hand_over_max_ns,packets_crc32,utc_offset_ns,utc_error_ns,packets_lost\n";
struct LoggedSweep {
    SweepLedger ledger;
    int line = 0;  ///< of the log
};
/// Reads the LIDAR.sweeps.csv of one LiDAR. Errors name file, line and column.
Result<std::vector<LoggedSweep>> read_sweep_log(const std::string& path);

/// A shot: the truth of the beam's axis, then what the packets state of it, before rounding.
struct ShotRow {
    std::int64_t t_ns = 0, packet = 0;  ///< simulation clock; number of the packet
    int block = 0, laser = 0;
    double azimuth_rad = 0, elevation_rad = 0;
    double range_m = 0;  ///< 0: the axis meets nothing
    Vec3 position_m{};   ///< LiDAR axes
    float reflectivity = 0;
    int body = -1;  ///< -1: none
    double incidence_rad = 0, velocity_m_s = 0;
    double reported_range_m = 0;  ///< 0: no return
    float reported_reflectivity = 0;
    double reported_velocity_m_s = 0;
    double second_range_m = 0;
    float second_reflectivity = 0;
};
/// Of shot i of the packet that the unit, made with `truth`, has just fired.
[[nodiscard]] ShotRow shot_row(const LidarUnit& unit, std::int64_t packet, std::size_t i) noexcept;

/// Header of LIDAR.shots.csv and of `narpa scan -o FILE.csv`: ShotRow.
inline constexpr std::string_view kShotHeader =
    "t_ns,packet,block,laser,azimuth_rad,elevation_rad,range_m,x_m,y_m,z_m,reflectivity,body,incidence_rad,"
    "velocity_m_s,reported_range_m,reported_reflectivity,reported_velocity_m_s,second_range_m,second_"
    "reflectivity\n";
/// The row of shot i of the packet that the unit, made with `truth`, has just fired, with its line end. Returns the
/// bytes used (RowLog::kMaxLine are enough). Allocates nothing.
std::size_t format_shot_row(std::span<char> out, const LidarUnit& unit, std::int64_t packet,
                            std::size_t i) noexcept;

/// Writes both files. After `create` nothing allocates or waits for the disk.
class SweepLog {
public:
    /// `shots`: LIDAR.shots.csv too.
    static Result<std::unique_ptr<SweepLog>> create(const std::string& folder, const std::string& lidar, bool shots,
                                                    bool wait_when_full);

    /// The packet that the unit has just fired and that was due and sent at these times. `lost`: datagrams so far.
    void add(const LidarUnit& unit, std::int64_t packet, std::int64_t t_due_ns, std::int64_t t_sent_ns,
             const RunUtc& utc, bool late, std::uint64_t lost) noexcept;
    /// This many packets were left out after the last one.
    void skip(std::uint64_t packets) noexcept { sweep_.skipped += packets; }
    /// Writes the last sweep and closes the files; an Error when any row was lost. `lost`: as in add.
    Status close(std::uint64_t lost);

private:
    void write_sweep(std::uint64_t lost) noexcept;

    std::unique_ptr<RowLog> sweeps_, shots_;  ///< `shots_` is null where they are not wanted
    SweepLedger sweep_;
    std::uint64_t lost_before_ = 0;  ///< until the sweep began
};

}  // namespace narpa
