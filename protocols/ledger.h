/// protocols/ledger.h - the time ledger of one camera frame: what it shows, when it was made, what it cost and what
/// that left in error.
///
/// All times are nanoseconds of the simulation clock. The ledger goes to the CSV log, to CAN and, with
/// embedded_line = true, into the image's last row (protocols/video/embedded_line.h). ledger_fields.h has the table
/// of its fields.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "protocols/camera_control.h"

namespace narpa {

/// What limited the frame.
enum class BudgetKind : std::uint8_t {
    samples,  ///< samples for each pixel
    rays,     ///< rays of all kinds
    time,     ///< nanoseconds from the end of its exposure to its hand-over
};
inline constexpr std::array<std::string_view, 3> kBudgetKinds{"samples", "rays", "time"};

/// What was handed over in place of the frame. After a missed deadline the scene's late_policy decides.
enum class Delivery : std::uint8_t {
    frame,     ///< itself
    nothing,   ///< drop
    repeated,  ///< the last frame that was in time; black before there was one
    blank,     ///< black
};
inline constexpr std::array<std::string_view, 4> kDeliveries{"frame", "nothing", "repeated", "blank"};

/// How far the frame got, by FrameLedger::step.
inline constexpr std::array<std::string_view, 7> kStepNames{"refined",  "one_sample", "no_indirect", "coarse_2",
                                                            "coarse_4", "nothing",    "sparse"};

struct FrameLedger {
    static constexpr std::size_t kPasses = 8;
    using Passes = std::array<std::uint32_t, kPasses>;

    std::uint32_t frame = 0;        ///< frame number k; exposure mid = k * period, except for operated cameras
    std::uint8_t camera = 0;        ///< index of the camera in the scene
    std::uint8_t pose_counter = 0;  ///< counter of the newest pose command that the frame used
    bool pose_stale = false;        ///< a commanded body had no command, or one older than stale_after_s
    bool deadline_met = true;
    Delivery delivery = Delivery::frame;
    std::uint8_t step = 0;  ///< index into kStepNames
    BudgetKind budget_kind = BudgetKind::samples;
    std::uint64_t budget = 0;   ///< in the units of its kind
    std::uint64_t samples = 0;  ///< through the camera
    std::uint64_t rays = 0;     ///< of all kinds
    Passes passes{};  ///< camera samples of each pass after the first; with paths and only sunlight, the last
                      ///< passes sample direct sunlight
    float samples_per_pixel = 0;  ///< mean over the image
    float expected_error = -1;    ///< standard error of a pixel, root mean square over the image,
                                  ///< as a fraction of full scale; negative: not estimated
    std::int64_t t_pose_ns = 0;   ///< time of validity of that command; 0 when there was none
    std::int64_t t_exposure_start_ns = 0, t_exposure_mid_ns = 0, t_exposure_end_ns = 0;
    std::int64_t t_render_start_ns = 0, t_render_end_ns = 0;
    std::int64_t t_hand_over_ns = 0;  ///< 0: not handed over, or not yet: the embedded line is written before
    std::int64_t t_deadline_ns = 0;   ///< for the hand-over
    // Settings of the frame besides its exposure: CameraSettings.
    std::uint8_t command_counter = 0;  ///< of the newest camera command in effect; 0 before the first
    TriggerMode trigger = TriggerMode::free_running;
    std::int16_t gain_cdb = 0;
    std::uint8_t binning = 1;
    std::uint16_t region_x = 0, region_y = 0, region_width = 0, region_height = 0;
    // The clock when the frame was handed over; in the log only.
    std::int64_t utc_offset_ns = 0;  ///< UTC of simulation time 0, since 1970
    std::int64_t utc_error_ns = -1;  ///< estimated error of the system's UTC; -1: unknown, or not taken from it
    /// The trigger of the exposure: when it reached this machine, and when narpa took it; in the log only. 0: the
    /// camera runs freely.
    std::int64_t t_trigger_ns = 0, t_trigger_taken_ns = 0;
    friend bool operator==(const FrameLedger&, const FrameLedger&) = default;
};

}  // namespace narpa
