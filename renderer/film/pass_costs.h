/// renderer/film/pass_costs.h - how long passes take, learnt from frame to frame.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace narpa {

/// Wall time of passes with all threads at work. It decides which passes begin, never what they hold.
class PassCosts {
public:
    enum class Of : std::uint8_t { centres, plan, samples, show };

    void note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept;
    /// A pass was expected to take too long, and so was not measured: lowers the estimate a little, so that one bad
    /// measurement does not last.
    void doubt(Of what) noexcept;
    [[nodiscard]] bool known(Of what) const noexcept { return measurements_[index(what)] > 0; }
    /// Of so many pixels or samples.
    [[nodiscard]] std::int64_t expected_ns(Of what, std::uint64_t pieces) const noexcept {
        return static_cast<std::int64_t>(ns_[index(what)] * static_cast<double>(pieces));
    }
    /// How many fit.
    [[nodiscard]] std::uint64_t fitting(Of what, std::int64_t wall_ns) const noexcept;

private:
    static constexpr std::size_t index(Of what) noexcept { return static_cast<std::size_t>(what); }
    std::array<double, 4> ns_{100, 30, 200, 10};  ///< each; guesses at first
    std::array<double, 4> least_ns_{};            ///< lower bound of what doubt leaves
    std::array<std::uint8_t, 4> measurements_{};  ///< so far; 2: two or more
};

}  // namespace narpa
