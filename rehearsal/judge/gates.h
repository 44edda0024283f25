/// rehearsal/judge/gates.h - helpers of the gates: clearance of the corridor, limit monitors, texts for reasons.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// Distance to the wall of the approach corridor in metres, positive inside. Before the port a cone about its x
/// axis; behind the port's plane a half sphere.
[[nodiscard]] double corridor_clearance_m(const Gates::Corridor& corridor, const Vec3& position_m);

/// A limit on every sample of a series: the first violation, and the worst (or the closest approach to the limit).
template <class Sample>
struct LimitMonitor {
    std::size_t seen = 0;
    std::optional<Sample> first, worst;
    double margin = std::numeric_limits<double>::infinity();

    /// A negative margin is a violation. True for the first one.
    bool check(const Sample& sample, double margin_now) {
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

/// The program whose message was due next and did not come: why a run broke off.
[[nodiscard]] std::string missing_sender(const Scenario& scenario, const BusRecord& bus);

}  // namespace narpa::rehearsal
