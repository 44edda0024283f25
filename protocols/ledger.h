/// protocols/ledger.h - the time ledger of one camera frame: what it shows, when it was made, what it cost.
///
/// All times are nanoseconds of the simulation clock. It goes to the log, to CAN (protocols/can) and, when the
/// scene asks, into the image's last row (protocols/video/embedded_line.h).
#pragma once

#include <cstdint>

namespace narpa {

struct FrameLedger {
    std::uint32_t frame = 0;        ///< frame number k; exposure mid = k * period
    std::uint8_t camera = 0;        ///< index of the camera in the scene
    std::uint8_t pose_counter = 0;  ///< counter of the newest pose command that the frame used
    bool pose_stale = false;        ///< a commanded body had no command, or one older than stale_after_s
    bool deadline_met = true;
    std::uint16_t samples_per_pixel = 0;
    float expected_error = 0;    ///< standard error of the mean, as a fraction of full scale; 0: not estimated
    std::int64_t t_pose_ns = 0;  ///< time of validity of that command; 0 when there was none
    std::int64_t t_exposure_start_ns = 0, t_exposure_mid_ns = 0, t_exposure_end_ns = 0;
    std::int64_t t_render_start_ns = 0, t_render_end_ns = 0;
    std::int64_t t_hand_over_ns = 0;  ///< 0 in the embedded line: it is written before the hand-over
    std::int64_t t_deadline_ns = 0;
    friend bool operator==(const FrameLedger&, const FrameLedger&) = default;
};

}  // namespace narpa
