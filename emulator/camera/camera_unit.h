/// emulator/camera/camera_unit.h - one emulated camera: frame number -> the bytes of the device's format.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "emulator/camera/camera_control.h"
#include "emulator/world.h"
#include "protocols/ledger.h"
#include "renderer/detector/sensor_array.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Seed of the noise and samples of a camera. Each camera of a scene has its own, so that their noise is
/// independent; the first has the scene's.
[[nodiscard]] constexpr std::uint64_t seed_of_camera(std::uint64_t scene_seed, std::size_t index) noexcept {
    return scene_seed + index * 0x9e3779b97f4a7c15u;  // 2^64 over the golden ratio (D. E. Knuth, TAOCP 3, 6.4)
}

/// The radiance in each band at full scale of the digital numbers, W m^-2 sr^-1. A frame's expected error is a
/// fraction of it.
[[nodiscard]] double full_scale_radiance(const Camera& camera) noexcept;

/// Pose of the camera during an exposure, from the first row's start to the last one's end, with the times of its
/// rows. The bodies move as in `at`. `motions`: of every body at mid-exposure.
[[nodiscard]] CameraPose camera_pose(const World& world, const Camera& camera, const BodyPoses& at,
                                     std::int64_t start_ns, std::int64_t end_ns,
                                     std::span<const Motion> motions) noexcept;

/// Recent durations from the end of the radiance to the hand-over: the part of a time budget reserved for them.
class Allowance {
public:
    void add(std::int64_t ns) noexcept { last_[next_++ % last_.size()] = ns; }
    /// The longest of the last 512. Stalls are rare but recur, and one frame in a thousand may be late, so the
    /// memory is of that order.
    [[nodiscard]] std::int64_t ns() const noexcept { return *std::max_element(last_.begin(), last_.end()); }

private:
    std::array<std::int64_t, 512> last_{};
    std::size_t next_ = 0;
};

/// Durations of the parts of a frame, wall time.
struct FrameDurations {
    std::int64_t radiance_ns = 0;  ///< rays and light
    std::int64_t sensor_ns = 0;    ///< detector and conversion to the device's bytes
};

class CameraUnit {
public:
    /// `world` must outlive the unit. Allocates all memory; `expose` allocates nothing after its first call.
    CameraUnit(const World& world, std::size_t index);

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] VideoFormat format() const noexcept;
    /// The middle of the exposure of frame k: k * period.
    [[nodiscard]] std::int64_t t_mid_ns(std::uint32_t frame) const noexcept { return frame * camera_.period_ns; }
    [[nodiscard]] std::int64_t exposure_ns() const noexcept { return narpa::exposure_ns(camera_); }

    /// Renders frame `frame` as it is at t_mid. The same frame number, time and poses give the same bytes.
    /// Fills the ledger's identity, pose and exposure; the caller adds when it was made. `aovs` may be null.
    /// `deadline_ns`: CLOCK_MONOTONIC, for the hand-over; 0: none, which only scenes without a time budget allow.
    /// `pixels_done` counts the finished pixels, for a progress display; may be null.
    FrameLedger expose(std::uint32_t frame, std::int64_t t_mid_ns, std::int64_t deadline_ns = 0,
                       Aovs* aovs = nullptr, std::atomic<std::size_t>* pixels_done = nullptr);
    /// Settings of all later frames. Only for a camera that is operated (Camera::control).
    void set(const CameraSettings& settings, std::uint8_t command_counter) noexcept;
    /// Where the camera is in all later frames: World::set_mount.
    void set_mount(int mount, const Rigid3& T_mount_camera) noexcept;
    [[nodiscard]] const CameraSettings& settings() const noexcept { return settings_; }
    [[nodiscard]] std::uint8_t command_counter() const noexcept { return command_counter_; }
    /// Renders a frame of maximum work and discards it: triggers one-time allocations and calibrates the renderer.
    void warm_up();
    /// Writes the ledger into the last row, if the scene has embedded_line.
    void embed(const FrameLedger& ledger) noexcept;
    /// The last frame was handed over at this time, CLOCK_MONOTONIC.
    void handed_over(std::int64_t t_ns) noexcept { allowance_.add(t_ns - t_radiance_ns_); }

    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }
    [[nodiscard]] const RadianceImage& radiance() const noexcept { return radiance_; }
    [[nodiscard]] const BodyPoses& placement() const noexcept { return placement_; }
    /// Durations of the last frame.
    [[nodiscard]] const FrameDurations& durations() const noexcept { return durations_; }
    /// Motion of every body at mid-exposure of the last frame.
    [[nodiscard]] std::span<const Motion> motions() const noexcept { return motions_; }
    /// The same at the exposure's start and end; empty where the camera has no shutter.
    [[nodiscard]] std::span<const Motion> motions_at_start() const noexcept { return starts_; }
    [[nodiscard]] std::span<const Motion> motions_at_end() const noexcept { return ends_; }

private:
    [[nodiscard]] FrameBudget budget(std::int64_t deadline_ns) const noexcept;
    FrameLedger expose(std::uint32_t frame, std::int64_t t_mid_ns, const FrameBudget& budget, Aovs* aovs,
                       std::atomic<std::size_t>* pixels_done);
    /// The rendered frame, or a test pattern in its place, in bytes_.
    FrameAccount take_image(std::uint32_t frame, std::int64_t start_ns, std::int64_t end_ns,
                            const FrameBudget& budget, Aovs* aovs, std::atomic<std::size_t>* pixels_done);
    FrameAccount put_test_pattern(std::uint32_t frame) noexcept;
    void put_cost(const FrameAccount& account, FrameLedger& ledger) const noexcept;

    const World& world_;
    Camera camera_;
    std::uint8_t index_;
    CameraSettings settings_;
    std::uint8_t command_counter_ = 0;
    double full_scale_;
    BodyPoses placement_;
    std::vector<Motion> motions_, starts_, ends_;
    CameraRenderer renderer_;
    std::uint64_t array_seed_;                   ///< of sensor_array_
    std::unique_ptr<SensorArray> sensor_array_;  ///< null where the scene names none
    RadianceImage radiance_;
    Allowance allowance_;
    FrameDurations durations_;
    std::int64_t t_radiance_ns_ = 0;  ///< end of the last frame's radiance, or its deadline if that is earlier
    std::vector<std::uint8_t> bytes_;
};

}  // namespace narpa
