/// emulator/bus/can_node.h - narpa on the CAN bus: commands in, heartbeat, ledgers and estimates out. One thread
/// uses it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "drivers/can/can_bus.h"
#include "drivers/can/client_hub.h"
#include "emulator/camera/camera_control.h"
#include "emulator/log/row_log.h"
#include "emulator/world.h"
#include "protocols/can/messages.h"
#include "protocols/can/pose_map.h"

namespace narpa {

/// Commands accepted and rejected; the bus has counters of its own.
struct CommandCounters {
    std::uint64_t taken = 0;          ///< complete commands accepted by a track
    std::uint64_t past = 0;           ///< time of validity not after the newest: late, repeated, out of order
    std::uint64_t overrun = 0;        ///< too far ahead for the depth of the track
    std::uint64_t too_far_ahead = 0;  ///< time of validity beyond the scene's command_ahead_max_s
    std::array<std::uint64_t, kDecodeStatusCount> by_status{};  ///< of frames and sets to bodies and cameras
    std::uint64_t foreign = 0;                                  ///< frames of other identifiers
    std::uint64_t not_logged = 0;                               ///< frames left out of the log
    std::uint64_t missed = 0;                                   ///< lost commands, by gaps in the counters

    /// Frames and commands rejected, by cause.
    [[nodiscard]] std::vector<std::pair<std::string_view, std::uint64_t>> rejected() const;
};

/// Pose commands of one body that its track refused.
struct RefusedPoses {
    std::uint32_t can_id = 0;
    std::uint64_t past = 0, overrun = 0;
    std::int64_t newest_ns = 0;  ///< time of validity of the newest one that was accepted
};

/// A pose command that lies before those of its body: the dynamics have begun again.
struct Restart {
    std::uint32_t can_id = 0;
    PoseCommand command{};
};

/// Why a user should hear of commands that were refused.
struct PoseRefusals {
    std::uint64_t too_far_ahead = 0;
    std::vector<RefusedPoses>
        bodies{};  ///< of which kManyRefused commands in a row were refused as past or overrun
};

/// The log has every command, every message of a closed loop and everything that narpa sends. Of other frames it
/// has at most kOtherFramesPerSecond of the simulation clock (a full bus of 1 Mbit/s carries about 8000), and fewer
/// where the disk is slow; the others are counted, and a line of the log states how many: protocols/can/README.md.
class CanNode {
public:
    static constexpr std::uint64_t kOtherFramesPerSecond = 10'000;
    static constexpr std::size_t kLogLines = 16'384;
    /// This many refused commands of a body in a row are not repeats by the bus: the sender's clock or rate is
    /// wrong.
    static constexpr std::uint32_t kManyRefused = 10;
    /// A command that lies further back than this, or not after its body's first one, is of dynamics that have
    /// begun again; others are late, repeated or out of order.
    static constexpr std::int64_t kRestart_ns = 1'000'000'000;

    /// `log` may be null. All outlive the node. In real time frames of a recorded bus wait for their time; in
    /// lockstep they are received at once.
    CanNode(World& world, CanBus& bus, RowLog* log, bool lockstep);

    [[nodiscard]] CanBus& bus() noexcept { return bus_; }
    [[nodiscard]] const CanBus& bus() const noexcept { return bus_; }
    /// Null where the bus does not know its clients.
    [[nodiscard]] const ClientHub* hub() const noexcept { return hub_; }

    /// Waits until `receive` may have something to read or the time is over; may wake early.
    void wait(std::int64_t t_now_ns, std::int64_t timeout_ns) noexcept;
    /// Reads one waiting frame. `moved`: it completed a command that was accepted. False: no frame was waiting.
    bool receive(std::int64_t t_now_ns, bool& moved) noexcept;
    /// No frame is left on the bus or waits for its time.
    [[nodiscard]] bool ended() const noexcept { return bus_.ended() && !waiting_; }
    /// Sends a message in the form that the bus carries: any with a Codec.
    template <class Message>
    void send(const Message& message, std::int64_t t_now_ns) noexcept {
        for (const CanFrame& frame : encode(message, bus_.carries_fd())) put(frame, t_now_ns);
    }
    /// The same with the bus's own counter: +1 with every message of its identifiers, from any sensor.
    template <class Message>
    void send_numbered(Message message, std::int64_t t_now_ns) noexcept {
        message.counter = counter(base_id_of(message))++;
        send(message, t_now_ns);
    }
    void send(Heartbeat heartbeat, std::int64_t t_now_ns) noexcept;
    void send(const CanFrame& frame, std::int64_t t_now_ns) noexcept { put(frame, t_now_ns); }
    /// SYNC of CiA 301, which this run's own cameras obey too.
    void send_sync(std::int64_t t_now_ns) noexcept;
    /// Sends the last heartbeat again, for clients that have joined since; not where the bus knows that there are
    /// none. It is not logged: a log in lockstep does not depend on wall time.
    void repeat_heartbeat() noexcept;
    /// A command to a camera from another source than the bus; the reply goes to the bus as well.
    void command(const CameraCommand& command, std::int64_t t_now_ns) noexcept;
    /// Exposes one frame of each camera in this trigger mode, all at the same time: the longest of their latencies
    /// after the trigger.
    void expose(TriggerMode mode, const TriggerTimes& trigger) noexcept;
    /// Sends commands and triggers to this camera too, which must outlive the run. Call before the run.
    void operate(CameraControl& camera) { cameras_.push_back(&camera); }

    /// The latest and first time for which every commanded body has commands: they limit the clock of a lockstep
    /// run. `commanded` is false until every commanded body has a command.
    [[nodiscard]] bool commanded() const noexcept;
    [[nodiscard]] std::int64_t granted_ns() const noexcept;
    [[nodiscard]] std::int64_t first_ns() const noexcept;

    [[nodiscard]] CommandCounters counters() const noexcept;
    /// The refusals so far. Allocates nothing if `out` has room for the commanded bodies.
    void refusals(PoseRefusals& out) const;
    [[nodiscard]] std::size_t commanded_bodies() const noexcept { return listeners_.size(); }
    /// The command with which the dynamics have begun again, where the scene answers that by a new run; it was not
    /// accepted.
    [[nodiscard]] const std::optional<Restart>& restart() const noexcept { return restart_; }
    /// The first command of the run that follows. Call before the run.
    void begin_with(const Restart& restart) noexcept;
    /// True if they call for a notice to the user.
    [[nodiscard]] bool refuses_poses() const noexcept { return many_refused_ || counters_.too_far_ahead > 0; }

private:
    struct Listener {
        PoseTrack* track;
        PoseDecoder decoder;
        std::optional<MappedPoseDecoder> mapped{};  ///< of messages of the user's own
        int last_counter = -1;
        RefusedPoses refused{};
        std::uint32_t refused_in_a_row = 0;
        bool many_refused = false;
    };
    bool next_frame(std::int64_t t_now_ns) noexcept;
    void note_refusal(Listener& listener, TrackStatus status) noexcept;
    [[nodiscard]] bool begins_again(const PoseTrack& track, const PoseCommand& command) const noexcept;
    PoseStatus take(const CanFrame& frame, std::int64_t t_now_ns, bool& moved) noexcept;
    DecodeStatus take_camera_message(const CanFrame& frame, std::int64_t t_now_ns) noexcept;
    void trigger(CameraTrigger trigger, std::int64_t t_now_ns) noexcept;
    /// Answers a command or trigger that has an unknown choice.
    void refuse(std::uint8_t counter, std::uint8_t camera, bool to_trigger, std::int64_t t_now_ns) noexcept;
    [[nodiscard]] std::uint8_t& counter(std::uint32_t base_id) noexcept {
        return sent_[base_id / kBaseIdStep % sent_.size()];
    }
    [[nodiscard]] std::int64_t latest_ns(const PoseTrack& track, std::int64_t t_now_ns) const noexcept;
    void put(const CanFrame& frame, std::int64_t t_now_ns) noexcept;
    void log_frame(const CanFrame& frame, std::int64_t t_ns, std::string_view interface = "narpa") noexcept;
    void log_other(const CanFrame& frame, std::int64_t t_ns) noexcept;
    void log_left_out(std::int64_t t_ns) noexcept;

    CanBus& bus_;
    ClientHub* hub_;
    RowLog* log_;
    bool lockstep_, pace_;
    std::int64_t ahead_max_ns_;
    ReceivedFrame received_{};
    bool waiting_ = false;  ///< received_ is not due yet
    std::vector<Listener> listeners_;
    std::vector<CameraControl*> cameras_;  ///< those that are operated
    MessageDecoder<CameraCommand> camera_commands_;
    MessageDecoder<CameraTrigger> camera_triggers_;
    CommandCounters counters_{};
    bool many_refused_ = false;  ///< of any body
    bool new_runs_;              ///< TimeSettings::on_restart
    std::optional<Restart> restart_{};
    std::array<std::uint8_t, 0x800 / kBaseIdStep> sent_{};  ///< the next counter of each base identifier
    CanFrame heartbeat_{};                                  ///< the last
    std::int64_t log_second_ = 0;                           ///< in which logged_others_ were logged
    std::uint64_t logged_others_ = 0;
    std::uint32_t left_out_ = 0;  ///< since the last line that states it
};

}  // namespace narpa
