#include "rehearsal/navigation/bus_link.h"

#include <utility>

namespace narpa::rehearsal {

BusLink::BusLink(std::unique_ptr<CanBus> bus) : bus_(std::move(bus)) {
    for (std::uint8_t camera = 0; camera < kMaxTelemetryCameras; ++camera) ledger_decoders_.emplace_back(camera);
}

void BusLink::receive(std::int64_t timeout_ns) {
    if (timeout_ns > 0) bus_->wait(timeout_ns);
    ReceivedFrame received;
    for (int i = 0; i < kFramesPerTurn && bus_->receive(received); ++i) {
        const CanFrame& frame = received.frame;
        if (clock_.accept(received)) continue;
        const std::int64_t now_ns = clock_.newest().t_ns;
        DynamicsReport dynamics;
        if (dynamics_decoder_.accept(frame, now_ns, dynamics) == DecodeStatus::complete) dynamics_ = dynamics;
        AttitudeReport attitude;
        if (attitude_decoder_.accept(frame, now_ns, attitude) == DecodeStatus::complete) attitude_ = attitude;
        LidarBeamReport beam;
        if (beam_decoder_.accept(frame, now_ns, beam) == DecodeStatus::complete) beams_.push_back(beam);
        for (LedgerDecoder& decoder : ledger_decoders_) {
            FrameLedger l;
            if (decoder.accept(frame, now_ns, l) == DecodeStatus::complete)
                notices_.push_back({l.camera, l.t_exposure_mid_ns, l.t_hand_over_ns, l.delivery});
        }
    }
}

std::vector<FrameNotice> BusLink::take_notices() {
    return std::exchange(notices_, {});
}

std::vector<LidarBeamReport> BusLink::take_beams(std::int64_t t_ns) {
    const auto later =
        std::stable_partition(beams_.begin(), beams_.end(), [&](const auto& b) { return b.t_ns <= t_ns; });
    std::vector<LidarBeamReport> taken(beams_.begin(), later);
    beams_.erase(beams_.begin(), later);
    return taken;
}

template <class Message>
bool BusLink::send(const Message& message) {
    bool all = true;
    for (const CanFrame& frame : encode(message, bus_->carries_fd())) all = bus_->send(frame) && all;
    return all;
}
template bool BusLink::send(const NavigationEstimate&);
template bool BusLink::send(const ActuatorCommand&);

std::uint64_t BusLink::bad_messages() const noexcept {
    std::uint64_t n = 0;
    for (const DecodeStatus status :
         {DecodeStatus::too_short, DecodeStatus::too_long, DecodeStatus::wrong_kind, DecodeStatus::bad_checksum,
          DecodeStatus::incomplete_set, DecodeStatus::not_a_number, DecodeStatus::not_unit}) {
        n += dynamics_decoder_.count(status) + attitude_decoder_.count(status) + beam_decoder_.count(status);
        for (const LedgerDecoder& decoder : ledger_decoders_) n += decoder.count(status);
    }
    return n;
}

}  // namespace narpa::rehearsal
