/// protocols/camera_control.h - a camera that is operated during a run: commands, replies, and the settings of each
/// frame.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace narpa {

/// What starts an exposure.
enum class TriggerMode : std::uint8_t {
    free_running,  ///< the camera's own rate
    command,       ///< a CameraTrigger
    sync,          ///< the SYNC object of CANopen (CiA 301)
    external,      ///< a pulse of a line or a datagram: drivers/pulse/pulse_source.h
};
inline constexpr std::array<std::string_view, 4> kTriggerModes{"free_running", "command", "sync", "external"};

/// Pixels of the image that are read out; the others are black.
struct Region {
    std::uint16_t x = 0, y = 0, width = 0, height = 0;
    friend bool operator==(const Region&, const Region&) = default;
};

struct CameraSettings {
    bool running = true;
    TriggerMode trigger = TriggerMode::free_running;
    bool auto_exposure = false;
    std::int64_t exposure_ns = 0;  ///< of one row
    std::int16_t gain_cdb = 0;     ///< over the gain of the scene's detector, 0.01 dB
    std::uint8_t binning = 1;      ///< n: blocks of n x n pixels are averaged
    Region region{};
    std::int64_t period_ns = 0;  ///< from frame to frame, and the least between triggers
    friend bool operator==(const CameraSettings&, const CameraSettings&) = default;
};

/// Changes settings together; absent ones stay as they are.
struct CameraCommand {
    std::uint8_t counter = 0;  ///< +1 with every one; the reply repeats it
    std::uint8_t camera = 0;   ///< index in the scene
    std::optional<bool> running{};
    std::optional<TriggerMode> trigger{};
    std::optional<bool> auto_exposure{};
    std::optional<std::uint8_t> binning{};
    std::optional<std::int64_t> exposure_ns{};
    std::optional<std::int16_t> gain_cdb{};
    std::optional<std::uint16_t> region_x{}, region_y{}, region_width{}, region_height{};
    std::optional<std::int64_t> period_ns{};
    friend bool operator==(const CameraCommand&, const CameraCommand&) = default;
};

/// Exposes one frame of each camera in the mask; all begin at the same time.
struct CameraTrigger {
    std::uint8_t counter = 0;
    std::uint16_t cameras = 0;  ///< bit i: camera i of the scene
    bool at_once = true;        ///< as soon as the cameras can, instead of at t_ns
    std::int64_t t_ns = 0;      ///< start of the exposure
    friend bool operator==(const CameraTrigger&, const CameraTrigger&) = default;
};

/// The result of a command or trigger.
enum class CameraAnswer : std::uint8_t {
    accepted,
    not_controllable,  ///< no such camera, or the scene gives it no `control`
    exposure_range,    ///< outside the camera's limits, or exposure and rows take a period or longer
    gain_range,
    region_range,   ///< empty, or not within the image
    binning_range,  ///< or not of this pixel format
    period_range,
    auto_exposure,  ///< an exposure time, while auto-exposure is on
    wrong_mode,     ///< a trigger, while the camera is stopped or in another trigger mode
    too_soon,       ///< a trigger before the latency or the exposure before it is over
    overrun,        ///< too many are waiting to take effect
};
inline constexpr std::array<std::string_view, 11> kCameraAnswers{
    "accepted",     "not_controllable", "exposure_range", "gain_range", "region_range", "binning_range",
    "period_range", "auto_exposure",    "wrong_mode",     "too_soon",   "overrun"};

/// One for each camera that a command or a trigger addresses.
struct CameraReply {
    std::uint8_t counter = 0;  ///< of the command or trigger
    std::uint8_t camera = 0;
    bool to_trigger = false;
    CameraAnswer answer = CameraAnswer::accepted;
    /// Accepted settings: they apply from the first frame whose exposure, with them, starts at or after this time.
    /// Accepted trigger: the exposure starts at this time. Refused: when that happened.
    std::int64_t t_ns = 0;
    friend bool operator==(const CameraReply&, const CameraReply&) = default;
};

/// The settings of a frame.
struct CameraState {
    std::uint32_t frame = 0;
    std::uint8_t camera = 0;
    std::uint8_t command_counter = 0;  ///< of the newest command in effect; 0 before the first
    CameraSettings settings{};
    friend bool operator==(const CameraState&, const CameraState&) = default;
};

}  // namespace narpa
