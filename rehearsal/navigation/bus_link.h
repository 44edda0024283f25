/// rehearsal/navigation/bus_link.h - the navigation's messages on CAN. Pose commands, and the poses in ledgers, are
/// not read: they are the truth.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/can/can_bus.h"
#include "drivers/can/remote_clock.h"
#include "protocols/can/messages.h"

namespace narpa::rehearsal {

/// A camera's report of a handed-over frame.
struct FrameNotice {
    std::uint8_t camera = 0;  ///< index in the scene
    std::int64_t t_mid_ns = 0, t_hand_over_ns = 0;
    Delivery delivery = Delivery::frame;
};

class BusLink {
public:
    explicit BusLink(std::unique_ptr<CanBus> bus);

    /// Decodes all waiting messages; waits for the first one for at most `timeout_ns`.
    void receive(std::int64_t timeout_ns);

    [[nodiscard]] const RemoteClock& clock() const noexcept { return clock_; }
    [[nodiscard]] const std::optional<DynamicsReport>& dynamics() const noexcept { return dynamics_; }
    /// The newest report.
    [[nodiscard]] const std::optional<AttitudeReport>& attitude() const noexcept { return attitude_; }
    /// Frames handed over since the last call, in the order of the bus.
    [[nodiscard]] std::vector<FrameNotice> take_notices();

    /// Shots of LiDARs on CAN that fired by t_ns, since the last call, in the order of the bus.
    [[nodiscard]] std::vector<LidarBeamReport> take_beams(std::int64_t t_ns);

    /// Returns false if the message was dropped, in part or as a whole.
    template <class Message>
    bool send(const Message& message);

    /// Messages that could not be decoded.
    [[nodiscard]] std::uint64_t bad_messages() const noexcept;
    [[nodiscard]] const CanCounters& counters() const noexcept { return bus_->counters(); }
    [[nodiscard]] std::string description() const { return bus_->description(); }

private:
    std::unique_ptr<CanBus> bus_;
    RemoteClock clock_;
    MessageDecoder<DynamicsReport> dynamics_decoder_;
    MessageDecoder<AttitudeReport> attitude_decoder_;
    MessageDecoder<LidarBeamReport> beam_decoder_;
    std::vector<LedgerDecoder> ledger_decoders_;
    std::optional<DynamicsReport> dynamics_;
    std::optional<AttitudeReport> attitude_;
    std::vector<FrameNotice> notices_;
    std::vector<LidarBeamReport> beams_;
};

}  // namespace narpa::rehearsal
