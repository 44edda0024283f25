/// renderer/frame/budgeted_frame.h - renders one frame within a budget of time or rays by choosing its passes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/frame/frame_passes.h"

namespace narpa {

/// Measured wall time of passes with all threads at work. It decides which passes begin, not their contents.
class PassCosts {
public:
    enum class Of : std::uint8_t { centres, plan, samples, sunlight, show };

    void note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept;
    /// Lowers the estimate a little after a pass was skipped (and so not measured) as too slow, so that one bad
    /// measurement does not last.
    void doubt(Of what) noexcept;
    [[nodiscard]] bool known(Of what) const noexcept { return measurements_[index(what)] > 0; }
    /// Wall time expected for this number of pixels or samples.
    [[nodiscard]] std::int64_t expected_ns(Of what, std::uint64_t pieces) const noexcept {
        return static_cast<std::int64_t>(ns_[index(what)] * static_cast<double>(pieces));
    }
    /// Number of pixels or samples that fit into this wall time.
    [[nodiscard]] std::uint64_t fitting(Of what, std::int64_t wall_ns) const noexcept;

private:
    static constexpr std::size_t index(Of what) noexcept { return static_cast<std::size_t>(what); }
    std::array<double, 5> ns_{100, 30, 200, 100, 10};  ///< per pixel or sample; initial guesses
    std::array<double, 5> min_ns_{};                   ///< lower bound of doubt()
    std::array<std::uint8_t, 5> measurements_{};       ///< so far; 2: two or more
};

/// Renders the frame; its budget is of any kind but `samples`. `variance` may be null.
FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
