/// protocols/can/messages/frame_ledger.h - the time ledger of one camera frame, by the table of its fields.
#pragma once

#include "protocols/can/codec.h"
#include "protocols/ledger_fields.h"

namespace narpa {

inline constexpr auto kLedgerSignals = [] {
    std::array<Signal, 23> signals{};
    std::transform(kLedgerFields.begin(), kLedgerFields.begin() + signals.size(), signals.begin(),
                   [](const LedgerField& field) { return field.signal; });
    return signals;
}();

inline constexpr std::array<std::string_view, 10> kLedgerFrames{
    "LedgerFrame",    "LedgerExposureMid", "LedgerPoseTime", "LedgerExposure", "LedgerRender",
    "LedgerHandOver", "LedgerQuality",     "LedgerSamples",  "LedgerRays",     "LedgerBudget"};

inline constexpr SetLayout kLedgerLayout =
    describe_set("Ledger", "ledger", "Time ledger of one camera frame", kTelemetryBaseId, kFromNarpa, kLedgerFrames,
                 kLedgerSignals, Instances::per_camera);

/// Times other than exposure mid and pose time are sent as whole microseconds after exposure mid. Of the passes
/// only their number is sent; the samples of each are in the log.
template <>
struct Codec<FrameLedger> {
    static constexpr const SetLayout& layout = kLedgerLayout;
    static std::uint32_t instance(const FrameLedger& l) noexcept { return l.camera; }
    static auto& counter(auto& l) noexcept { return l.frame; }
    static void fields(auto& l, const auto& each) noexcept {
        constexpr bool reads = !std::is_const_v<std::remove_reference_t<decltype(l)>>;
        if constexpr (reads) l = {};
        bool pose_known = l.t_pose_ns != 0;
        for (std::size_t i = 0; i < kLedgerSignals.size(); ++i)
            std::visit(
                [&]<class Member>(Member member) {
                    if constexpr (std::is_same_v<Member, std::monostate>) {
                        each(pose_known);
                    } else if constexpr (std::is_same_v<Member, FrameLedger::Passes FrameLedger::*>) {
                        const auto is_made = [](std::uint32_t samples) { return samples > 0; };
                        auto passes = static_cast<std::uint8_t>(std::ranges::count_if(l.*member, is_made));
                        each(passes);
                    } else {
                        each(l.*member);
                    }
                },
                kLedgerFields[i].member);
        if constexpr (reads)
            if (!pose_known) l.t_pose_ns = 0;
    }
    static void encoded(const FrameLedger& l, RawSignals& raw) noexcept {
        if (l.t_hand_over_ns == 0) raw[index_of(kLedgerSignals, "HandOver")] = kNotAvailable;
    }
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_signals(layout.signals, raw, true); }
};
using LedgerDecoder = MessageDecoder<FrameLedger>;

}  // namespace narpa
