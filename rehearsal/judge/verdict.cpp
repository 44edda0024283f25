#include "rehearsal/judge/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <nlohmann/json.hpp>

namespace narpa::rehearsal {
namespace {

/// P(X >= k) of n trials with probability p each.
double at_least(std::size_t k, std::size_t n, double p) {
    if (k == 0) return 1;
    if (p <= 0 || p >= 1) return p <= 0 ? 0 : 1;
    const double trials = static_cast<double>(n);
    double sum = 0;
    for (std::size_t i = k; i <= n; ++i) {
        const double hits = static_cast<double>(i);
        sum += std::exp(std::lgamma(trials + 1) - std::lgamma(hits + 1) - std::lgamma(trials - hits + 1) +
                        hits * std::log(p) + (trials - hits) * std::log1p(-p));
    }
    return std::min(sum, 1.0);
}

/// The point in [0, 1] where a rising function crosses `level`.
template <class Function>
double crossing(Function f, double level) {
    double low = 0, high = 1;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (f(middle) < level ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace

Distribution distribution(std::vector<double> values) {
    Distribution d;
    d.count = values.size();
    if (values.empty()) return d;
    std::sort(values.begin(), values.end());
    const double n = static_cast<double>(values.size());
    for (const double v : values) d.mean += v / n;
    double squares = 0;
    for (const double v : values) squares += (v - d.mean) * (v - d.mean);
    if (values.size() > 1) d.sigma = std::sqrt(squares / (n - 1));
    const auto rank = [&](double share) {
        const double at = std::ceil(share * n - 1e-9);
        return values[static_cast<std::size_t>(std::clamp(at, 1.0, n)) - 1];
    };
    d.min = values.front();
    d.p50 = rank(0.5);
    d.p90 = rank(0.9);
    d.p99 = rank(0.99);
    d.p999 = rank(0.999);
    d.max = values.back();
    return d;
}

std::pair<double, double> success_interval(std::size_t successes, std::size_t trials, double confidence) {
    assert(trials > 0 && successes <= trials);
    const double tail = 0.5 * (1 - confidence);
    const double low =
        successes == 0 ? 0 : crossing([&](double p) { return at_least(successes, trials, p); }, tail);
    const double high =
        successes == trials ? 1 : crossing([&](double p) { return at_least(successes + 1, trials, p); }, 1 - tail);
    return {low, high};
}

namespace {

using nlohmann::json;

json number_or_null(const std::optional<double>& value) {
    return value && std::isfinite(*value) ? json(*value) : json(nullptr);
}

json gate_json(const GateResult& g) {
    return {{"name", g.name},
            {"asked", g.asked},
            {"state", std::string(kGateStates[static_cast<std::size_t>(g.state)])},
            {"reason", g.reason},
            {"details", g.details},
            {"margin", number_or_null(g.margin)},
            {"unit", g.unit},
            {"t_first_s", number_or_null(g.t_first_s)},
            {"t_worst_s", number_or_null(g.t_worst_s)}};
}

json contact_json(const Contact& c) {
    json conditions = json::array();
    for (const ContactCondition& k : c.conditions)
        conditions.push_back({{"name", k.name},
                              {"title", k.title},
                              {"unit", k.unit},
                              {"value", k.value},
                              {"min", k.min},
                              {"max", k.max},
                              {"within", k.within()}});
    const Vec3 &p = c.state.position_m(), &v = c.state.velocity_m_s, r = c.state.misalignment_rad();
    return {{"t_s", c.t_s},
            {"captured", c.captured},
            {"position_m", {p.x, p.y, p.z}},
            {"velocity_m_s", {v.x, v.y, v.z}},
            {"rotation_rad", {r.x, r.y, r.z}},
            {"conditions", conditions}};
}

}  // namespace

json to_json(const Distribution& d) {
    if (d.count == 0) return nullptr;
    return {{"count", d.count}, {"mean", d.mean}, {"sigma", d.sigma}, {"min", d.min}, {"p50", d.p50},
            {"p90", d.p90},     {"p99", d.p99},   {"p99.9", d.p999},  {"max", d.max}};
}

std::string full_reason(const GateResult& gate) {
    std::string text = gate.reason;
    for (const std::string& detail : gate.details) text += "; " + detail;
    return text;
}

json to_json(const Verdict& v) {
    json gates = json::array();
    for (const GateResult& g : v.gates) gates.push_back(gate_json(g));
    const NavigationStatistics& n = v.navigation;
    const LedgerStatistics& l = v.ledger;
    return {{"passed", v.passed},
            {"outcome", v.outcome},
            {"headline", v.headline},
            {"t_end_s", v.t_end_s},
            {"mode", v.lockstep ? "lockstep" : "real time"},
            {"gates", gates},
            {"contact", v.contact ? contact_json(*v.contact) : json(nullptr)},
            {"navigation",
             {{"estimates", n.estimates},
              {"with_frames", n.with_frames},
              {"with_sweeps", n.with_sweeps},
              {"unjudged", n.unjudged},
              {"share_within", n.share_within},
              {"nees", n.nees},
              {"position_m", to_json(n.position_m)},
              {"attitude_deg", to_json(n.attitude_deg)}}},
            {"frames",
             {{"ledgers", l.frames},
              {"handed_over", l.handed_over},
              {"deadlines_met", l.deadlines_met},
              {"stale", l.stale},
              {"pose_to_hand_over_ms", to_json(l.latency_ms)},
              {"mid_exposure_to_hand_over_ms", to_json(l.exposure_to_hand_over_ms)},
              {"render_ms", to_json(l.render_ms)},
              {"hand_over_after_deadline_ms", to_json(l.late_ms)}}},
            {"bus",
             {{"poses", v.poses},
              {"estimates", v.estimates},
              {"commands", v.commands},
              {"heartbeats", v.heartbeats},
              {"refused", v.refused},
              {"late", v.late}}}};
}

}  // namespace narpa::rehearsal
