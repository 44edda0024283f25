/// rehearsal/judge/bus_record.h - the decoded messages of the three programs, and the navigation's estimates with
/// the truth of the same time.
///
/// Each stream is ordered by its own times: two receivers that get the messages of different senders in different
/// orders obtain the same record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <vector>

#include "base/pose.h"
#include "protocols/can/messages.h"
#include "protocols/closed_loop.h"
#include "protocols/ledger.h"
#include "rehearsal/contact/port_state.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

class MotionTrack {
public:
    /// Returns false if it is not newer than the last one; it is then ignored.
    bool push(std::int64_t t_ns, const Motion& motion);
    /// Exact at the times of commands; in between a cubic through positions and velocities, and the shortest arc
    /// between attitudes. Empty before the first and after the last.
    [[nodiscard]] std::optional<Motion> at(std::int64_t t_ns) const;
    [[nodiscard]] bool empty() const { return samples_.empty(); }
    [[nodiscard]] std::int64_t newest_ns() const { return samples_.back().t_ns; }

private:
    struct Sample {
        std::int64_t t_ns;
        Motion motion;
    };
    std::vector<Sample> samples_;
};

/// The true port state at one instant.
struct TruthState : PortState {
    std::int64_t t_ns = 0;  ///< simulation clock
};

/// An estimate with the truth of the same time. Errors and standard deviations: of the target in the chaser's body
/// axes.
struct JudgedEstimate {
    std::int64_t t_ns = 0;
    Vec3 position_error_m{}, rotation_error_rad{};
    Vec3 sigma_position_m{}, sigma_rotation_rad{};
    Vec3 port_position_m{};  ///< of the chaser's port, target's port axes, as estimated
    std::uint8_t frames = 0, sweeps = 0;

    /// Largest |error| / standard deviation of the six.
    [[nodiscard]] double largest_in_sigmas() const;
    /// Sum of their squares: 6 on average if the covariance is right (correlations are not sent on CAN).
    [[nodiscard]] double nees() const;
};

struct HeartbeatCount {
    std::uint64_t received = 0;
    bool lockstep = false;
};

class BusRecord {
public:
    /// What one frame has completed.
    struct Update {
        std::size_t truth = 0, estimates = 0;  ///< new elements at the ends of their series
        bool report = false, command = false;
    };

    explicit BusRecord(const Scenario& scenario);

    /// `t_reference_ns`: within 39 h of the simulation clock.
    Update accept(const CanFrame& frame, std::int64_t t_reference_ns);

    std::vector<TruthState> truth;
    std::vector<JudgedEstimate> estimates;
    std::vector<ActuatorCommand> commands;
    std::vector<DynamicsReport> reports;
    std::vector<FrameLedger> ledgers;
    HeartbeatCount heartbeats;
    std::uint64_t refused = 0;  ///< frames of a known message that could not be decoded
    std::uint64_t late = 0;     ///< messages that were not newer than the last of their kind

    /// The scenario's time 0 on the simulation clock; the first pose's time until a report has come.
    [[nodiscard]] std::int64_t t_start_ns() const;
    [[nodiscard]] double seconds(std::int64_t t_ns) const {
        return static_cast<double>(t_ns - t_start_ns()) * 1e-9;
    }
    /// Estimates without a truth of their time so far.
    [[nodiscard]] std::size_t unjudged() const { return waiting_.size(); }
    /// Empty unless the pose commands of both bodies cover this time.
    [[nodiscard]] std::optional<TruthState> truth_at(std::int64_t t_ns) const;
    /// The navigation's command that was valid at that time.
    [[nodiscard]] const ActuatorCommand* command_before(std::int64_t t_ns) const;
    [[nodiscard]] const DynamicsReport* first_report(DynamicsPhase phase) const;

    static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
    std::int64_t t_pose_ns = kNever;       ///< newest of the chaser's
    std::int64_t t_heartbeat_ns = kNever;  ///< newest

private:
    bool take_pose(const CanFrame& frame, std::int64_t t_reference_ns, PoseDecoder& decoder, MotionTrack& track);
    std::size_t compare_with_truth();
    std::size_t judge_waiting();
    bool count(DecodeStatus status);

    const Scenario& scenario_;
    PoseDecoder target_decoder_, chaser_decoder_;
    MotionTrack target_, chaser_;
    std::deque<std::int64_t> chaser_times_;  ///< waiting for the target's command of that time
    MessageDecoder<ActuatorCommand> command_decoder_;
    MessageDecoder<NavigationEstimate> estimate_decoder_;
    MessageDecoder<DynamicsReport> report_decoder_;
    std::vector<LedgerDecoder> ledger_decoders_;
    std::deque<NavigationEstimate> waiting_;
    std::int64_t t_estimate_ns_ = kNever;
};

}  // namespace narpa::rehearsal
