/// renderer/integrator/phase_clock.h - the time of rendering by phase.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace narpa {

/// Phases of rendering; times in ns, summed over the threads.
enum class Phase : std::uint8_t { aim, rays, shading, shadow_rays, indirect, passes };
inline constexpr std::size_t kPhases = 6;
using PhaseTimes = std::array<std::int64_t, kPhases>;

/// CLOCK_MONOTONIC.
[[nodiscard]] inline std::int64_t now_ns() noexcept {
    return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Measures the time of a batch per phase, if enabled.
class PhaseClock {
public:
    explicit PhaseClock(PhaseTimes* times) noexcept : times_(times), last_ns_(times != nullptr ? now_ns() : 0) {}
    /// Adds the time since the last call, or since the start, to this phase.
    void ends(Phase phase) noexcept {
        if (times_ == nullptr) return;
        const std::int64_t now = now_ns();
        (*times_)[static_cast<std::size_t>(phase)] += now - last_ns_;
        last_ns_ = now;
    }

private:
    PhaseTimes* times_;
    std::int64_t last_ns_;
};

}  // namespace narpa
