/// rehearsal/navigation/estimation/frame_history.h - finds frames that a camera delivers again in place of new
/// ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "renderer/scene/scene.h"

namespace narpa::rehearsal {

/// Two frames with the same bytes are one if the detector has noise, or if the target has moved by a pixel between
/// them; else the image of something at rest may be the same. An embedded line states the frame's time.
class FrameHistory {
public:
    /// `camera` outlives it.
    explicit FrameHistory(const Camera& camera) : camera_(camera) {}

    /// Why the frame is none of `t_ns` (mid-exposure); empty: nothing speaks against it. Keeps the frame.
    /// `T_camera_target`: predicted.
    [[nodiscard]] std::string staleness(std::span<const std::uint8_t> bytes, std::int64_t t_ns,
                                        const Rigid3& T_camera_target);

    static constexpr std::size_t kKept = 64;

private:
    struct Frame {
        std::uint64_t hash = 0;
        Rigid3 T_camera_target{};
    };
    [[nodiscard]] bool has_noise() const;
    [[nodiscard]] double moved_px(const Rigid3& a, const Rigid3& b) const;

    const Camera& camera_;
    std::array<Frame, kKept> kept_{};
    std::size_t seen_ = 0;
};

}  // namespace narpa::rehearsal
