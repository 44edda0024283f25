/// renderer/frame/pass_costs.h - wall time that passes are expected to take.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>

#include "renderer/frame/tuning.h"

namespace narpa {

/// Measured wall time of passes with all threads at work. It decides which passes begin, not their contents.
class PassCosts {
public:
    /// centres: with direct light alone; paths: with all light.
    enum class Of : std::uint8_t { centres, paths, plan, samples, sunlight, show, reconstruction };

    /// `pieces`: pixels or samples of the pass.
    void record(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept {
        assert(wall_ns >= 0);
        if (pieces == 0) return;
        Cost& c = costs_[index(what)];
        const double now = static_cast<double>(wall_ns) / static_cast<double>(pieces);
        if (pieces < tuning::kMinPieces && !(c.measurements > 0 && now < c.ns)) return;
        // Limits the weight of an outlier: a delayed frame predicts little of the next.
        if (c.measurements == 0)
            c.ns = now;
        else if (c.measurements == 1)
            c.ns = std::min(c.ns, now);
        else
            c.ns +=
                tuning::kNewWeight * (std::clamp(now, c.ns / tuning::kMaxChange, tuning::kMaxChange * c.ns) - c.ns);
        if (c.measurements < 2) ++c.measurements;
        c.min_ns = tuning::kMinDecayed * c.ns;
    }
    /// Lowers the estimate a little after a pass was skipped (and so not measured) as too slow, so that one bad
    /// measurement does not last.
    void decay(Of what) noexcept {
        Cost& c = costs_[index(what)];
        c.ns = std::max(tuning::kSkippedDecay * c.ns, c.min_ns);
    }
    [[nodiscard]] bool known(Of what) const noexcept { return costs_[index(what)].measurements > 0; }
    /// Wall time expected for this number of pixels or samples.
    [[nodiscard]] std::int64_t expected_ns(Of what, std::uint64_t pieces) const noexcept {
        return static_cast<std::int64_t>(costs_[index(what)].ns * static_cast<double>(pieces));
    }
    /// Number of pixels or samples that fit into this wall time.
    [[nodiscard]] std::uint64_t fitting(Of what, std::int64_t wall_ns) const noexcept {
        return static_cast<std::uint64_t>(static_cast<double>(std::max<std::int64_t>(wall_ns, 0)) /
                                          costs_[index(what)].ns);
    }

private:
    struct Cost {
        double ns = 0;                  ///< per pixel or sample
        double min_ns = 0;              ///< lower bound of decay()
        std::uint8_t measurements = 0;  ///< so far; 2: two or more
    };
    static constexpr std::size_t index(Of what) noexcept { return static_cast<std::size_t>(what); }
    std::array<Cost, 7> costs_ = [] {
        std::array<Cost, 7> initial{};
        for (std::size_t i = 0; i < initial.size(); ++i) initial[i].ns = tuning::kInitialCosts_ns[i];
        return initial;
    }();
};

}  // namespace narpa
