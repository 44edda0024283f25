/// renderer/scene/camera.h - a camera of a scene: its mount, projection, optics, detector and timing.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/pixel_format.h"
#include "base/pose.h"
#include "protocols/camera_control.h"
#include "renderer/detector/detector_settings.h"
#include "renderer/optics/optics.h"
#include "renderer/projection/pinhole.h"
#include "renderer/scene/course.h"

namespace narpa {

/// When the rows of an image are exposed. Without it every frame shows one instant, mid-exposure.
struct Shutter {
    std::int64_t row_time_ns = 0;  ///< from the start of one row's exposure to the next one's; 0: a global shutter
};

/// A camera that is operated over CAN while it runs: protocols/camera_control.h.
struct CameraControlLimits {
    std::int64_t latency_ns = 10'000'000;             ///< from a command to the first exposure that it may act on
    TriggerMode trigger = TriggerMode::free_running;  ///< at the start
    std::int64_t exposure_min_ns = 10'000, exposure_max_ns = 0;
    std::int16_t gain_max_cdb = 2400;
    bool auto_exposure = false;  ///< at the start
    double level = 0.3;          ///< target of auto-exposure: mean of the image, share of full scale
};

enum class LatePolicy : std::uint8_t { drop, repeat, late, blank };

/// A frame of known pixels in place of the image, to test the link and its driver: protocols/video/test_pattern.h.
enum class TestPattern : std::uint8_t { none, counter, prbs };
inline constexpr std::array<std::string_view, 3> kTestPatterns{"none", "counter", "prbs"};

struct Camera {
    std::string name;
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_camera{};
    std::shared_ptr<const Course> course{};  ///< of a camera on the world that moves; T_mount_camera: at time 0
    int width = 640, height = 480;
    std::shared_ptr<const CameraModel> model{};  ///< its projection; never null in a scene that was read
    std::int64_t period_ns = 100'000'000;        ///< 1 / rate_hz
    PixelFormat format = PixelFormat::grey;      ///< of its frames
    LinkLayout link{};                           ///< of the frames that sinks send
    bool embedded_line = false;                  ///< the last row carries the frame's identity and ledger
    TestPattern test_pattern = TestPattern::none;
    LatePolicy late = LatePolicy::late;
    double white_radiance = 0;         ///< radiance that an ideal sensor maps to full scale, W m^-2 sr^-1
    std::optional<Detector> detector;  ///< none: an ideal sensor without noise (see white_radiance)
    std::optional<Shutter> shutter{};
    std::optional<CameraControlLimits> control{};
    Optics optics{};

    [[nodiscard]] VideoFormat video_format() const { return {width, height, format, period_ns, link}; }
    [[nodiscard]] ImagePlane plane() const { return {width, height, model}; }
    /// Valid while the camera stays as it is.
    operator ImageSensor() const noexcept {  // NOLINT(google-explicit-constructor)
        return {name, width, height, format, white_radiance, detector ? &*detector : nullptr};
    }
};

}  // namespace narpa
