/// emulator/camera_unit.h - one camera under emulation: frame number -> the bytes that the sensor would put out.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "emulator/world.h"
#include "protocols/ledger.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// The radiance in each band that takes the camera's digital numbers to the top of their scale, W m^-2 sr^-1: what
/// a frame's expected error is a fraction of.
[[nodiscard]] double full_scale_radiance(const Camera& camera) noexcept;

/// What a frame's way from its radiance to the sinks took lately: so much of a time budget is kept for it.
class Allowance {
public:
    void add(std::int64_t ns) noexcept { last_[next_++ % last_.size()] = ns; }
    /// The longest of the last 512: what holds a thread up comes seldom, and then again. One frame in a thousand
    /// may be late, so memory has to be of that order.
    [[nodiscard]] std::int64_t ns() const noexcept { return *std::max_element(last_.begin(), last_.end()); }

private:
    std::array<std::int64_t, 512> last_{};
    std::size_t next_ = 0;
};

/// How long the parts of a frame took, wall time.
struct FrameDurations {
    std::int64_t radiance_ns = 0;  ///< rays and light
    std::int64_t sensor_ns = 0;    ///< detector and conversion to the device's bytes
};

class CameraUnit {
public:
    /// `world` must outlive the unit. All memory is taken here; `expose` allocates nothing after its first call.
    CameraUnit(const World& world, std::size_t index);

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] VideoFormat format() const noexcept;
    /// Frame k shows the middle of its exposure: k * period.
    [[nodiscard]] std::int64_t t_mid_ns(std::uint32_t frame) const noexcept { return frame * camera_.period_ns; }
    [[nodiscard]] std::int64_t exposure_ns() const noexcept;

    /// Renders frame `frame` as it is at t_mid. The same frame number, time and poses give the same bytes.
    /// Fills the ledger's identity, pose and exposure; the caller adds when it was made. `aovs` may be null.
    /// `deadline_ns`: CLOCK_MONOTONIC, for the hand-over; read only where the scene has a time budget.
    /// `pixels_done` is counted up meanwhile, for who wants to watch; null: nobody does.
    FrameLedger expose(std::uint32_t frame, std::int64_t t_mid_ns, std::int64_t deadline_ns = 0,
                       Aovs* aovs = nullptr, std::atomic<std::size_t>* pixels_done = nullptr);
    /// Makes a frame for nobody that takes all that frames of this scene can take: pays for what is needed once,
    /// and shows how fast the renderer is.
    void warm_up();
    /// Writes the ledger into the last row, where the scene asks for it.
    void embed(const FrameLedger& ledger) noexcept;
    /// The frame just exposed is out at this time, CLOCK_MONOTONIC: the next knows what to allow for.
    void handed_over(std::int64_t t_ns) noexcept { allowance_.add(t_ns - t_radiance_ns_); }

    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }
    [[nodiscard]] const RadianceImage& radiance() const noexcept { return radiance_; }
    [[nodiscard]] const BodyPoses& placement() const noexcept { return placement_; }
    /// Of the last frame.
    [[nodiscard]] const FrameDurations& durations() const noexcept { return durations_; }
    /// Of every body, as the last frame shows it.
    [[nodiscard]] std::span<const Motion> motions() const noexcept { return motions_; }

private:
    [[nodiscard]] FrameBudget budget(std::int64_t deadline_ns) const noexcept;
    FrameLedger expose(std::uint32_t frame, std::int64_t t_mid_ns, const FrameBudget& budget, Aovs* aovs,
                       std::atomic<std::size_t>* pixels_done);
    void tell_cost(const FrameAccount& account, FrameLedger& ledger) const noexcept;

    const World& world_;
    Camera camera_;
    std::uint8_t index_;
    double full_scale_;
    BodyPoses placement_;
    std::vector<Motion> motions_;
    CameraRenderer renderer_;
    RadianceImage radiance_;
    Allowance allowance_;
    FrameDurations durations_;
    std::int64_t t_radiance_ns_ = 0;  ///< of the last frame: when it was there, or ought to have been
    std::vector<std::uint8_t> bytes_;
};

}  // namespace narpa
