/// emulator/camera_unit.h - one camera under emulation: frame number -> the bytes that the sensor would put out.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "emulator/world.h"
#include "protocols/ledger.h"
#include "renderer/trace/camera_image.h"

namespace narpa {

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
    /// `pixels_done` is counted up meanwhile, for who wants to watch; null: nobody does.
    FrameLedger expose(std::uint32_t frame, std::int64_t t_mid_ns, Aovs* aovs = nullptr,
                       std::atomic<std::size_t>* pixels_done = nullptr);
    /// Writes the ledger into the last row, where the scene asks for it.
    void embed(const FrameLedger& ledger) noexcept;

    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }
    [[nodiscard]] const RadianceImage& radiance() const noexcept { return radiance_; }
    [[nodiscard]] const Placement& placement() const noexcept { return placement_; }

private:
    const World& world_;
    Camera camera_;
    std::uint8_t index_;
    Placement placement_;
    RadianceImage radiance_;
    std::vector<std::uint8_t> bytes_;
};

}  // namespace narpa
