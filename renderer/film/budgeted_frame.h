/// renderer/film/budgeted_frame.h - one frame within a budget: which passes it has time or rays for.
#pragma once

#include "renderer/film/frame_passes.h"

namespace narpa {

/// What passes have cost so far, from frame to frame; wall time, with all threads at work. Says which passes are
/// begun, never what they hold.
class PassCosts {
public:
    enum class Of : std::uint8_t { direct_middles, middles, plan, samples, show };

    void note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept;
    /// It was expected to take too long, and so not measured.
    void doubt(Of what) noexcept;
    [[nodiscard]] bool known(Of what) const noexcept { return measures_[index(what)] > 0; }
    /// Of so many pixels or samples.
    [[nodiscard]] std::int64_t expected_ns(Of what, std::uint64_t pieces) const noexcept {
        return static_cast<std::int64_t>(ns_[index(what)] * static_cast<double>(pieces));
    }
    /// How many fit.
    [[nodiscard]] std::uint64_t fitting(Of what, std::int64_t wall_ns) const noexcept;

private:
    static constexpr std::size_t index(Of what) noexcept { return static_cast<std::size_t>(what); }
    std::array<double, 5> ns_{100, 300, 30, 200, 10};  ///< apiece; guesses at first
    std::array<double, 5> least_ns_{};                 ///< that doubt leaves of them
    std::array<std::uint8_t, 5> measures_{};           ///< so far; 2: two or more
};

/// Makes the frame; its settings' budget is of any kind but `samples`. `variance` may be null.
FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const Rigid3& T_world_camera,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
