/// emulator/camera/camera_control.h - a camera that is operated over CAN while it runs: checks commands and
/// triggers as they come, and decides when the next exposure starts and with which settings.
///
/// The CAN thread calls `command`, `trigger` and `expose`, the camera's thread the rest. A command that is received
/// at t acts on the first frame whose exposure, with the new settings, starts at t + latency or later.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>

#include "base/spsc_ring.h"
#include "emulator/clock.h"
#include "protocols/camera_control.h"
#include "protocols/ledger.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// From the start of the first row's exposure to that of the last one's.
[[nodiscard]] std::int64_t rows_ns(const Camera& camera) noexcept;
/// From the start of the first row's exposure to the end of the last one's; 0 without a detector.
[[nodiscard]] std::int64_t exposure_ns(const Camera& camera) noexcept;

/// The settings of the camera in the scene.
[[nodiscard]] CameraSettings settings_of(const Camera& camera) noexcept;
/// The settings of a logged frame; trigger, period and auto-exposure are those of the scene.
[[nodiscard]] CameraSettings settings_of(const FrameLedger& ledger, const Camera& as_in_the_scene) noexcept;
/// Sets exposure time and gain of `camera`; other settings have no effect on it.
void apply(const CameraSettings& settings, const Camera& as_in_the_scene, Camera& camera) noexcept;

struct CameraControlCounters {
    std::uint64_t commands = 0, triggers = 0;  ///< accepted
    std::uint64_t commands_refused = 0, triggers_refused = 0;
    std::uint64_t triggers_dropped = 0;  ///< accepted, but the camera was stopped or in another mode by then
};

/// Of a trigger: when it reached this machine, and when narpa took it.
struct TriggerTimes {
    std::int64_t t_ns = 0, t_taken_ns = 0;
};

class CameraControl {
public:
    CameraControl(const Camera& camera, std::uint8_t index);
    [[nodiscard]] std::uint8_t camera() const noexcept { return index_; }

    // From the CAN thread. `t_now_ns`: when it was received.

    [[nodiscard]] CameraReply command(const CameraCommand& command, std::int64_t t_now_ns) noexcept;
    [[nodiscard]] CameraReply trigger(const CameraTrigger& trigger, std::int64_t t_now_ns) noexcept;
    /// On a SYNC object or an external pulse: exposes one frame at t_ns if the camera is in that trigger mode.
    void expose(TriggerMode mode, std::int64_t t_ns, const TriggerTimes& trigger) noexcept;
    /// True if the camera runs in this mode once all commands so far are in effect.
    [[nodiscard]] bool awaits(TriggerMode mode) const noexcept {
        return latest_.running && latest_.trigger == mode;
    }
    [[nodiscard]] std::int64_t latency_ns() const noexcept { return limits_.latency_ns; }
    /// The earliest start that a trigger received now may have.
    [[nodiscard]] std::int64_t earliest_trigger_ns(std::int64_t t_now_ns) const noexcept {
        return std::max(t_now_ns + limits_.latency_ns, t_next_trigger_ns_);
    }
    [[nodiscard]] CameraControlCounters counters() const noexcept;

    // From the camera's thread.

    /// Applies received commands and triggers, and plans the next exposure.
    void plan() noexcept;
    /// Free-running frames are at multiples of the period, from this time on.
    void start_at(std::int64_t t_ns) noexcept;
    /// Start of the next exposure; Clock::kNever while none is known.
    [[nodiscard]] std::int64_t t_start_ns() const noexcept { return t_start_ns_; }
    /// Settings of the next exposure.
    [[nodiscard]] const CameraSettings& settings() const noexcept { return settings_; }
    [[nodiscard]] std::uint8_t command_counter() const noexcept { return command_counter_; }
    /// Of the next exposure; 0 where the camera runs freely.
    [[nodiscard]] TriggerTimes trigger_times() const noexcept {
        return settings_.trigger != TriggerMode::free_running && trigger_ ? trigger_->times : TriggerTimes{};
    }
    /// Goes on to the next exposure after one was taken or skipped. `level`: mean of its image, as a fraction of
    /// full scale; absent: skipped.
    void advance(std::optional<double> level) noexcept;

private:
    struct Order {
        std::int64_t t_ns = 0;
        CameraSettings settings{};
        std::uint8_t counter = 0;
        std::uint64_t mode = 0;  ///< counts the changes of mode so far
    };
    struct Trigger {
        std::int64_t t_ns = 0;
        std::uint64_t mode = 0;  ///< value of this count for which it was accepted
        TriggerTimes times{};
    };
    [[nodiscard]] CameraAnswer check(const CameraCommand& command, const CameraSettings& wanted) const noexcept;
    [[nodiscard]] CameraAnswer take_trigger(TriggerMode mode, std::int64_t t_ns,
                                            const TriggerTimes& times) noexcept;
    bool adopt_next() noexcept;
    /// Start of the next exposure that is not free-running.
    [[nodiscard]] std::int64_t t_trigger_ns() const noexcept {
        return trigger_ && trigger_->mode == mode_ ? trigger_->t_ns : Clock::kNever;
    }
    /// From the start of the first row to the end of the last one.
    [[nodiscard]] std::int64_t image_ns(const CameraSettings& s) const noexcept { return s.exposure_ns + rows_ns_; }
    /// The longest exposure at this period: an image ends before the next begins.
    [[nodiscard]] std::int64_t longest_ns(const CameraSettings& s) const noexcept {
        return std::min(limits_.exposure_max_ns, s.period_ns - rows_ns_ - 1);
    }

    const CameraControlLimits limits_;
    const std::uint8_t index_;
    const PixelFormat format_;
    const int width_, height_;
    const std::int64_t rows_ns_, min_period_ns_;

    // Used by the CAN thread.
    CameraSettings latest_;  ///< accepted, in effect or not
    std::uint64_t latest_mode_ = 0;
    std::int64_t t_next_trigger_ns_;  ///< the earliest start that a trigger may have
    CameraControlCounters counters_{};

    SpscRing<Order, 64> orders_;
    SpscRing<Trigger, 64> triggers_;
    std::atomic<std::int64_t> exposure_ns_;  ///< as set by auto-exposure
    std::atomic<std::uint64_t> dropped_{0};

    // Used by the camera's thread.
    CameraSettings settings_;
    std::uint8_t command_counter_ = 0;
    std::uint64_t mode_ = 0;
    std::optional<Order> order_;      ///< the next one that is not in effect
    std::optional<Trigger> trigger_;  ///< the next one that is not exposed
    std::int64_t t_mid_ns_ = 0;       ///< of the next free-running frame
    std::int64_t t_start_ns_ = 0;
};

}  // namespace narpa
