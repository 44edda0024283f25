/// rehearsal/judge/gates.h - each gate: what it has seen so far, and what it says of it.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// Metres from the wall of the corridor, positive inside. Before the port a cone about its x axis; behind the
/// port's plane it closes with half a sphere.
[[nodiscard]] double corridor_clearance_m(const Gates::Corridor& corridor, const Vec3& position_m);

/// A gate on every instant of a series: the first one that violated it, and the worst (or the nearest to it).
template <class Sample>
struct Watch {
    std::size_t seen = 0;
    std::optional<Sample> first, worst;
    double margin = std::numeric_limits<double>::infinity();

    /// Negative margins violate. True for the first that does.
    bool see(const Sample& sample, double margin_now) {
        ++seen;
        if (margin_now < margin) margin = margin_now, worst = sample;
        if (margin_now >= 0 || first) return false;
        first = sample;
        return true;
    }
};

/// "at t = 12.300 s in leg 2 \"hold\"".
[[nodiscard]] std::string when(const Scenario& scenario, const BusRecord& bus, std::int64_t t_ns);
/// "leg 2 \"hold\"", of an index as the commands carry it.
[[nodiscard]] std::string leg_text(const Scenario& scenario, std::size_t leg);

/// Who was to speak next and did not: why a run broke off.
[[nodiscard]] std::string who_fell_silent(const Scenario& scenario, const BusRecord& bus);

}  // namespace narpa::rehearsal
