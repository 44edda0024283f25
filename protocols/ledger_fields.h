/// protocols/ledger_fields.h - the field table of the frame ledger. CAN messages, the DBC, the CSV log and the
/// embedded line are all written and read by it.
#pragma once

#include <algorithm>
#include <type_traits>
#include <variant>

#include "protocols/can/signals.h"
#include "protocols/ledger.h"

namespace narpa {

struct LedgerField {
    /// Member of FrameLedger. monostate: derived from other fields.
    std::variant<std::monostate, std::uint8_t FrameLedger::*, std::uint32_t FrameLedger::*,
                 std::uint64_t FrameLedger::*, std::int64_t FrameLedger::*, float FrameLedger::*,
                 bool FrameLedger::*, Delivery FrameLedger::*, BudgetKind FrameLedger::*,
                 FrameLedger::Passes FrameLedger::*, std::int16_t FrameLedger::*, std::uint16_t FrameLedger::*,
                 TriggerMode FrameLedger::*>
        member{};
    int column = -1;          ///< position in the CSV log; -1: not there
    std::string_view name{};  ///< of that column
    int line_offset = -1;     ///< byte in the embedded line, little-endian; -1: not there
    int line_bit = 0;         ///< of a flag, in that byte
    Signal signal{};          ///< on CAN; a time in "us" is relative to ExposureMid
};

/// Calls `use` with the field's value in the ledger; not for a derived field.
template <class Ledger, class Use>
void visit_field(const LedgerField& field, Ledger& ledger, const Use& use) {
    std::visit(
        [&](auto member) {
            if constexpr (!std::is_same_v<decltype(member), std::monostate>) use(ledger.*member);
        },
        field.member);
}

inline constexpr double kExpectedErrorSteps = 5e6;    ///< of full scale
inline constexpr double kSamplesPerPixelSteps = 256;  ///< of one sample

inline constexpr auto kLedgerSteps = numbered(kStepNames);
inline constexpr auto kLedgerBudgetKinds = numbered(kBudgetKinds);
inline constexpr auto kLedgerDeliveries = numbered(kDeliveries);
inline constexpr auto kLedgerTriggers = numbered(kTriggerModes);

// clang-format off
/// First those of the CAN message, in the order of the DBC. The last are on CAN in a message of their own, CameraState.
inline constexpr std::array<LedgerField, 35> kLedgerFields{{
    {&FrameLedger::frame, 0, "frame", 12, 0,
     {"Frame", "", "Frame number", 1, false, {0, 0, 32}, {0, 0, 32}}},
    {&FrameLedger::camera, -1, "", 6, 0,
     {"Camera", "", "Index of the camera in the scene", 1, false, {0, 32, 8}, {0, 32, 8}}},
    {&FrameLedger::pose_counter, 1, "pose_counter", 7, 0,
     {"PoseCounter", "", "Counter of the newest pose command in the frame", 1, false, {0, 40, 8}, {0, 40, 8}}},
    {&FrameLedger::t_exposure_mid_ns, 5, "t_exposure_mid_ns", 96, 0,
     {"ExposureMid", "ns", "Middle of the exposure: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}, {0, 48, 48}}},
    {&FrameLedger::t_pose_ns, 2, "t_pose_ns", 80, 0,
     {"PoseTime", "ns", "Time of validity of that command, modulo 2^48 ns", 1, false, {2, 0, 48}, {0, 96, 48}}},
    {&FrameLedger::t_exposure_start_ns, 4, "t_exposure_start_ns", 88, 0,
     {"ExposureStart", "us", "After ExposureMid", 1, true, {3, 0, 24}, {0, 144, 24}}},
    {&FrameLedger::t_exposure_end_ns, 6, "t_exposure_end_ns", 104, 0,
     {"ExposureEnd", "us", "After ExposureMid", 1, true, {3, 24, 24}, {0, 168, 24}}},
    {&FrameLedger::t_render_start_ns, 7, "t_render_start_ns", 112, 0,
     {"RenderStart", "us", "After ExposureMid", 1, true, {4, 0, 24}, {0, 192, 24}}},
    {&FrameLedger::t_render_end_ns, 8, "t_render_end_ns", 120, 0,
     {"RenderEnd", "us", "After ExposureMid", 1, true, {4, 24, 24}, {0, 216, 24}}},
    {&FrameLedger::t_hand_over_ns, 9, "t_hand_over_ns", 128, 0,
     {"HandOver", "us", "After ExposureMid; not available: not handed over", 1, true, {5, 0, 24}, {0, 240, 24}}},
    {&FrameLedger::t_deadline_ns, 10, "t_deadline_ns", 136, 0,
     {"Deadline", "us", "Of the hand-over, after ExposureMid", 1, true, {5, 24, 24}, {0, 264, 24}}},
    {&FrameLedger::samples_per_pixel, 15, "samples_per_pixel", 16, 0,
     {"SamplesPerPixel", "", "Mean over the image", kSamplesPerPixelSteps, false, {6, 24, 24}, {0, 288, 24}}},
    {&FrameLedger::expected_error, 20, "expected_error", 20, 0,
     {"ExpectedError", "", "Standard error of a pixel, RMS over the image, fraction of full scale; not available: not estimated",
      kExpectedErrorSteps, true, {6, 0, 24}, {0, 312, 24}}},
    {&FrameLedger::pose_stale, 3, "stale", 8, 0,
     {"PoseStale", "", "A commanded body had no command or an old one", 1, false, {8, 40, 1}, {0, 336, 1}}},
    {&FrameLedger::deadline_met, 11, "deadline_met", 8, 1,
     {"DeadlineMet", "", "Handed over in time", 1, false, {8, 41, 1}, {0, 337, 1}}},
    {{}, -1, "", -1, 0,
     {"PoseKnown", "", "PoseCounter and PoseTime hold a command", 1, false, {8, 42, 1}, {0, 338, 1}}},
    {&FrameLedger::step, 13, "step", 9, 0,
     {"Step", "", "How far the frame got", 1, false, {7, 40, 3}, {0, 339, 3}, kLedgerSteps}},
    {&FrameLedger::budget_kind, 18, "budget_kind", 10, 0,
     {"BudgetKind", "", "What limited the frame", 1, false, {9, 40, 2}, {0, 342, 2}, kLedgerBudgetKinds}},
    {&FrameLedger::delivery, 12, "delivery", -1, 0,
     {"Delivery", "", "What was handed over in the frame's place", 1, false, {9, 42, 2}, {0, 344, 2}, kLedgerDeliveries}},
    {&FrameLedger::passes, 17, "passes", 48, 0,
     {"Passes", "", "Passes after the first that count", 1, false, {7, 43, 4}, {0, 346, 4}}},
    {&FrameLedger::samples, 14, "samples", 24, 0,
     {"Samples", "", "Samples through the camera", 1, false, {7, 0, 40}, {0, 352, 40}}},
    {&FrameLedger::rays, 16, "rays", 32, 0,
     {"Rays", "", "Rays of all kinds", 1, false, {8, 0, 40}, {0, 392, 40}}},
    {&FrameLedger::budget, 19, "budget", 40, 0,
     {"Budget", "", "Samples a pixel, rays, or nanoseconds: see BudgetKind", 1, false, {9, 0, 40}, {0, 432, 40}}},
    {&FrameLedger::command_counter, 21, "command_counter", 11, 0, {}},
    {&FrameLedger::trigger, 22, "trigger", 155, 0, {.choices = kLedgerTriggers}},
    {&FrameLedger::gain_cdb, 23, "gain_cdb", 152, 0, {}},
    {&FrameLedger::binning, 24, "binning", 154, 0, {}},
    {&FrameLedger::region_x, 25, "region_x", 144, 0, {}},
    {&FrameLedger::region_y, 26, "region_y", 146, 0, {}},
    {&FrameLedger::region_width, 27, "region_width", 148, 0, {}},
    {&FrameLedger::region_height, 28, "region_height", 150, 0, {}},
    {&FrameLedger::utc_offset_ns, 29, "utc_offset_ns", -1, 0, {}},
    {&FrameLedger::utc_error_ns, 30, "utc_error_ns", -1, 0, {}},
    {&FrameLedger::t_trigger_ns, 31, "t_trigger_ns", -1, 0, {}},
    {&FrameLedger::t_trigger_taken_ns, 32, "t_trigger_taken_ns", -1, 0, {}},
}};
// clang-format on

/// The fields of the CSV log, in its order.
inline constexpr auto kLedgerColumns = [] {
    std::array<LedgerField, 33> columns{};
    for (const LedgerField& f : kLedgerFields)
        if (f.column >= 0) columns[static_cast<std::size_t>(f.column)] = f;
    return columns;
}();

}  // namespace narpa
