/// rehearsal/judge/verdict.h - the result of a rehearsal: gates, contact, statistics.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rehearsal/contact/port_state.h"

namespace narpa::rehearsal {

/// Percentiles are observed values, by nearest rank: the smallest that at least so many per cent do not exceed.
struct Distribution {
    std::size_t count = 0;
    double mean = 0, sigma = 0;  ///< sigma: of the population from this sample; 0 for fewer than two
    double min = 0, p50 = 0, p90 = 0, p99 = 0, p999 = 0, max = 0;
};
[[nodiscard]] Distribution distribution(std::vector<double> values);

/// Interval of the success probability compatible with `successes` of `trials`: the exact interval of C. Clopper
/// and E. Pearson, Biometrika 26 (1934), which contains the true value with at least `confidence`. trials > 0.
[[nodiscard]] std::pair<double, double> success_interval(std::size_t successes, std::size_t trials,
                                                         double confidence = 0.95);

enum class GateState : std::uint8_t { passed, failed, not_judged };
inline constexpr std::array<std::string_view, 3> kGateStates{"passed", "failed", "not judged"};

struct GateResult {
    std::string name{};   ///< "corridor", for machines
    std::string asked{};  ///< the requirement, for people
    GateState state = GateState::not_judged;
    std::string reason{};  ///< for people, one line: of a failed gate, the limit that was exceeded first
    std::vector<std::string> details{};              ///< further findings, a line each
    std::optional<double> margin{};                  ///< at the worst sample; negative: violated by so much
    std::string unit{};                              ///< of the margin
    std::optional<double> t_first_s{}, t_worst_s{};  ///< of the first violation; of the worst sample
};

struct Contact {
    double t_s = 0;
    bool captured = false;
    PortState state{};
    ContactConditions conditions;
};

/// The navigation's errors against its covariances.
struct NavigationStatistics {
    std::size_t estimates = 0, with_frames = 0, with_sweeps = 0, unjudged = 0;
    double share_within = 0;                ///< of the estimates, all six components within the gate's sigmas
    double nees = 0;                        ///< mean; 6 for an exact covariance
    Distribution position_m, attitude_deg;  ///< lengths of the errors
};

struct LedgerStatistics {
    std::size_t frames = 0, handed_over = 0, deadlines_met = 0, stale = 0;
    Distribution latency_ms;                ///< from the pose command's time to the hand-over
    Distribution exposure_to_hand_over_ms;  ///< from mid-exposure
    Distribution render_ms;
    Distribution late_ms;  ///< hand-over after its deadline; negative: before
};

struct Verdict {
    bool passed = false;
    std::string outcome;   ///< "Docked after 93.1 s, but gate navigation failed"
    std::string headline;  ///< the same with the gate's reason
    double t_end_s = 0;    ///< of the last pose
    bool lockstep = false;
    std::vector<GateResult> gates;
    std::optional<Contact> contact;
    NavigationStatistics navigation;
    LedgerStatistics ledger;
    std::uint64_t poses = 0, estimates = 0, commands = 0, heartbeats = 0, refused = 0, late = 0;
};

/// The reason and the details, with "; " between them.
[[nodiscard]] std::string full_reason(const GateResult& gate);

[[nodiscard]] nlohmann::json to_json(const Verdict& verdict);
[[nodiscard]] nlohmann::json to_json(const Distribution& d);

}  // namespace narpa::rehearsal
