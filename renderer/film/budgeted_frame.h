/// renderer/film/budgeted_frame.h - one frame within a budget: which passes it has time or rays for.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/film/frame_passes.h"

namespace narpa {

/// Wall time of passes with all threads at work. It decides which passes begin, never what they hold.
class PassCosts {
public:
    enum class Of : std::uint8_t { centres, plan, samples, sunlight, show };

    void note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept;
    /// A pass was expected to take too long, and so was not measured: lowers the estimate a little, so that one bad
    /// measurement does not last.
    void doubt(Of what) noexcept;
    [[nodiscard]] bool known(Of what) const noexcept { return measurements_[index(what)] > 0; }
    /// Wall time expected for this number of pixels or samples.
    [[nodiscard]] std::int64_t expected_ns(Of what, std::uint64_t pieces) const noexcept {
        return static_cast<std::int64_t>(ns_[index(what)] * static_cast<double>(pieces));
    }
    /// How many fit.
    [[nodiscard]] std::uint64_t fitting(Of what, std::int64_t wall_ns) const noexcept;

private:
    static constexpr std::size_t index(Of what) noexcept { return static_cast<std::size_t>(what); }
    std::array<double, 5> ns_{100, 30, 200, 100, 10};  ///< each; guesses at first
    std::array<double, 5> least_ns_{};                 ///< lower bound of what doubt leaves
    std::array<std::uint8_t, 5> measurements_{};       ///< so far; 2: two or more
};

/// Makes the frame; its settings' budget is of any kind but `samples`. `variance` may be null.
FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
