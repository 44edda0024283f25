/// python/module/emulator_session.h - the emulator in lockstep within a process: what narpa.Emulator does, without
/// Python. The loop is that of `narpa run --lockstep`; commands reach it as CAN frames over a bus in memory.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "drivers/can/can_bus.h"
#include "emulator/emulator.h"
#include "emulator/log/sweep_log.h"
#include "protocols/can/messages.h"
#include "protocols/ledger.h"

namespace narpa::python {

struct EmulatorSettings {
    std::vector<std::string> cameras, lidars;  ///< names of those that run
    std::string log_folder;                    ///< empty: no log
    int threads = 0;                           ///< that trace rays; 0: one per core
};

struct EmulatedFrame {
    std::size_t camera = 0;
    FrameLedger ledger;
    std::vector<std::uint8_t> bytes;   ///< in the camera's format
    std::vector<Rigid3> T_world_body;  ///< of every body at mid-exposure
};
/// A turn of a LiDAR.
struct EmulatedSweep {
    std::string lidar;
    std::int64_t number = 0;
    std::vector<ShotRow> shots;
    std::vector<std::vector<std::uint8_t>> packets;
};
/// What the emulator has made since the last step.
struct EmulatorOutput {
    std::vector<EmulatedFrame> frames;
    std::vector<EmulatedSweep> sweeps;  ///< those that are whole
    std::vector<CanFrame> can_frames;   ///< that it has sent
};

/// Functions of one session may be called from any threads; they take turns.
class EmulatorSession {
public:
    static Result<std::unique_ptr<EmulatorSession>> create(Scene scene, const EmulatorSettings& settings);
    ~EmulatorSession();

    [[nodiscard]] const Scene& scene() const noexcept { return emulator_->world().scene(); }
    /// Simulation time reached.
    [[nodiscard]] std::int64_t t_ns() const noexcept { return emulator_->t_ns(); }

    /// The pose of a body at a time, to be sent in the step that needs it. Errors: no such body or no can_id; not
    /// later than the body's last command; values that the message does not hold.
    Status command(const std::string& body, double time_s, const Motion& motion);
    /// Sends a frame at once: a command to a camera, or any other. Errors: a frame that no bus carries; a full
    /// queue.
    Status send(const CanFrame& frame);
    /// Advances the clock. `interrupted` is called now and then: true ends the step early, and the next
    /// step returns what was made. Errors: a body without
    /// commands up to that time; a refused command; a run that has ended.
    Result<EmulatorOutput> step(double to_s, const std::function<bool()>& interrupted);
    /// Ends the run: the sweeps that are not whole. `report`: as the JSON document of `narpa run`.
    Result<EmulatorOutput> finish(std::string& report);

private:
    class Observer;
    struct CommandedBody {
        std::string name;
        std::uint32_t can_id = 0;
        std::uint8_t counter = 0;
        bool any = false;
        std::int64_t newest_ns = 0;        ///< commanded
        std::int64_t sent_ns = INT64_MIN;  ///< of the last one sent
        std::deque<PoseCommand> waiting;
    };

    explicit EmulatorSession(std::unique_ptr<CanBus> bus) : bus_(std::move(bus)) {}
    [[nodiscard]] Status reaches(std::int64_t to_ns) const;
    /// The body whose next command is needed to reach that time; null: none.
    [[nodiscard]] CommandedBody* next_to_send(std::int64_t to_ns);
    void send_next(CommandedBody& body);
    void advance(std::int64_t to_ns, const std::function<bool()>& interrupted);
    void take_packet(const LidarUnit& unit, std::int64_t packet);
    [[nodiscard]] EmulatorOutput take_output();

    std::mutex mutex_;
    std::unique_ptr<CanBus> bus_;  ///< the client's side
    std::vector<CommandedBody> bodies_;
    std::vector<std::string> refusals_;
    EmulatorOutput made_;
    std::map<std::string, EmulatedSweep> sweeps_;  ///< that are not whole, by LiDAR
    StopFlag stop_{false};
    bool ended_ = false;
    std::unique_ptr<Emulator> emulator_;  ///< last: it calls the observers
};

}  // namespace narpa::python
