#include "rehearsal/judge/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <utility>

#include "base/constants.h"
#include "drivers/can/can_bus.h"

namespace narpa::rehearsal {

Judge::Judge(const Scenario& scenario, Failure on_failure)
    : scenario_(scenario), on_failure_(std::move(on_failure)) {}

void Judge::accept(const CanFrame& frame, std::int64_t t_reference_ns) {
    const BusRecord::Update update = bus_.accept(frame, t_reference_ns);
    if (update.report) check(bus_.reports.back());
    for (std::size_t i = bus_.truth.size() - update.truth; i < bus_.truth.size(); ++i) check(bus_.truth[i]);
    for (std::size_t i = bus_.estimates.size() - update.estimates; i < bus_.estimates.size(); ++i)
        check(bus_.estimates[i]);
    if (update.command && bus_.commands.back().abort != AbortReason::none && !abort_reported_) {
        abort_reported_ = true;
        if (scenario_.gates.complete) report("complete");
    }
}

void Judge::report(const GateResult& result) {
    ++failures_;
    if (on_failure_) on_failure_(result);
}

void Judge::report(std::string_view gate) {
    const auto kind = std::ranges::find(gate_kinds(), gate, &GateKind::name);
    assert(kind != gate_kinds().end());
    if (const GateResult now = result(*kind); now.state == GateState::failed) report(now);
}

void Judge::check(const DynamicsReport& report) {
    if (is_contact(report.phase) && !t_contact_ns_) t_contact_ns_ = report.t_ns;
    if (is_held(report.phase) && !t_captured_ns_) t_captured_ns_ = report.t_ns;
    if (!t_last_judged_ns_ && (is_held(report.phase) || report.phase == DynamicsPhase::touched_down))
        t_last_judged_ns_ = report.t_ns;
}

void Judge::check(const TruthState& state) {
    if (t_contact_ns_ && !contact_judged_ && state.t_ns >= *t_contact_ns_) {
        contact_judged_ = true;
        if (scenario_.gates.landing) {
            if (const auto touchdown = contact_made())
                for (const ContactCondition& c : touchdown->conditions)
                    if (!c.within()) report(landing(*touchdown, c, true));
        } else if (scenario_.gates.contact) {
            report("contact");
        }
    }
    if (t_last_judged_ns_ && state.t_ns > *t_last_judged_ns_) return;
    const Gates& gates = scenario_.gates;
    for (std::size_t i = 0; i < kGateKinds; ++i) {
        const GateKind& kind = gate_kinds()[i];
        const auto margin_m = kind.margin_m ? kind.margin_m(gates, state) : std::nullopt;
        if (margin_m && poses_[i].check(state, *margin_m)) report(result(kind));
    }
}

void Judge::check(const JudgedEstimate& estimate) {
    if (t_last_judged_ns_ && estimate.t_ns > *t_last_judged_ns_) return;
    const Gates::NavigationError limits = scenario_.gates.navigation.value_or(Gates::NavigationError{});
    const bool reported = position_.first || attitude_.first;
    sigmas_.check(estimate, limits.sigmas - estimate.largest_in_sigmas());
    measured_ |= estimate.frames + estimate.sweeps > 0;
    if (!measured_) return;  // before that the estimate is the scenario's start
    const bool too_far = position_.check(estimate, limits.position_m - norm(estimate.position_error_m));
    const bool too_turned =
        attitude_.check(estimate, limits.attitude_deg - norm(estimate.rotation_error_rad) * kDegPerRad);
    if (scenario_.gates.navigation && (too_far || too_turned) && !reported) report("navigation");
}

Status accept_log(Judge& judge, const std::string& path) {
    auto log = open_can_bus("log:" + path, CanRole::hub);
    if (!log) return log.error();
    for (ReceivedFrame received; (*log)->receive(received);) judge.accept(received.frame, received.t_received_ns);
    return Ok{};
}

// --- The verdict ----------------------------------------------------------------------------------------------

NavigationStatistics Judge::navigation_statistics() const {
    NavigationStatistics s;
    s.unjudged = bus_.unjudged();
    const double sigmas = scenario_.gates.navigation.value_or(Gates::NavigationError{}).sigmas;
    std::vector<double> position, attitude;
    std::size_t within = 0;
    bool measured = false;
    for (const JudgedEstimate& e : bus_.estimates) {
        if (t_last_judged_ns_ && e.t_ns > *t_last_judged_ns_) continue;
        ++s.estimates;
        s.with_frames += e.frames > 0;
        s.with_sweeps += e.sweeps > 0;
        within += e.largest_in_sigmas() <= sigmas;
        s.nees += e.nees();
        measured |= e.frames + e.sweeps > 0;
        if (!measured) continue;
        position.push_back(norm(e.position_error_m));
        attitude.push_back(norm(e.rotation_error_rad) * kDegPerRad);
    }
    if (s.estimates > 0) {
        s.share_within = static_cast<double>(within) / static_cast<double>(s.estimates);
        s.nees /= static_cast<double>(s.estimates);
    }
    s.position_m = distribution(std::move(position));
    s.attitude_deg = distribution(std::move(attitude));
    return s;
}

LedgerStatistics Judge::ledger_statistics() const {
    LedgerStatistics s;
    std::vector<double> latency, exposed, render, late;
    const DynamicsReport* const finished = bus_.first_report(DynamicsPhase::finished);
    for (const FrameLedger& l : bus_.ledgers) {
        ++s.frames;
        s.deadlines_met += l.deadline_met;
        s.stale += l.pose_stale;
        render.push_back(static_cast<double>(l.t_render_end_ns - l.t_render_start_ns) * 1e-6);
        if (l.t_hand_over_ns == 0 || l.delivery == Delivery::nothing) continue;
        ++s.handed_over;
        // Frames before the first pose or after the last do not have a pose of their own.
        if (l.t_pose_ns >= bus_.t_start_ns() && (!finished || l.t_exposure_mid_ns <= finished->t_ns))
            latency.push_back(static_cast<double>(l.t_hand_over_ns - l.t_pose_ns) * 1e-6);
        exposed.push_back(static_cast<double>(l.t_hand_over_ns - l.t_exposure_mid_ns) * 1e-6);
        late.push_back(static_cast<double>(l.t_hand_over_ns - l.t_deadline_ns) * 1e-6);
    }
    s.latency_ms = distribution(std::move(latency));
    s.exposure_to_hand_over_ms = distribution(std::move(exposed));
    s.render_ms = distribution(std::move(render));
    s.late_ms = distribution(std::move(late));
    return s;
}

void Judge::set_headline(Verdict& v, const std::string& trouble) const {
    const auto failed = std::find_if(v.gates.begin(), v.gates.end(),
                                     [](const GateResult& g) { return g.state == GateState::failed; });
    const std::string what = t_captured_ns_ ? fmt::format("{} after {:.1f} s", scenario_.gear ? "Landed" : "Docked",
                                                          bus_.seconds(*t_captured_ns_))
                                            : fmt::format("Flown for {:.1f} s", v.t_end_s);
    v.outcome = v.headline =
        trouble.empty() ? what + ", all gates passed" : fmt::format("{}, but {}", what, trouble);
    if (!trouble.empty() || failed == v.gates.end()) return;
    // The gate that failed first is the likely cause; an unfinished run is usually its consequence.
    auto cause = failed;
    for (auto g = failed; g != v.gates.end(); ++g)
        if (g->state == GateState::failed && g->t_first_s.value_or(1e30) < cause->t_first_s.value_or(1e30))
            cause = g;
    v.outcome = fmt::format("{}, but gate {} failed", what, cause->name);
    v.headline = v.outcome + ": " + cause->reason;
}

Verdict Judge::finish(const std::string& trouble) const {
    Verdict v;
    const Gates& gates = scenario_.gates;
    v.contact = contact_made();
    for (const GateKind& kind : gate_kinds()) {
        if (!kind.is_asked(gates)) continue;
        if (kind.margin_m || kind.judge)
            v.gates.push_back(result(kind));
        else
            add_landing_gates(v);
    }
    if (const auto complete = std::ranges::find(v.gates, "complete", &GateResult::name); !trouble.empty()) {
        complete->state = GateState::failed;
        complete->details.insert(complete->details.begin(), std::exchange(complete->reason, trouble));
    }
    v.passed = std::none_of(v.gates.begin(), v.gates.end(),
                            [](const GateResult& g) { return g.state == GateState::failed; });
    v.t_end_s = bus_.truth.empty() ? 0 : bus_.seconds(bus_.truth.back().t_ns);
    v.lockstep = bus_.heartbeats.lockstep;
    v.navigation = navigation_statistics();
    v.ledger = ledger_statistics();
    v.poses = bus_.truth.size();
    v.estimates = bus_.estimates.size();
    v.commands = bus_.commands.size();
    v.heartbeats = bus_.heartbeats.received;
    v.refused = bus_.refused;
    v.late = bus_.late;
    set_headline(v, trouble);
    return v;
}

}  // namespace narpa::rehearsal
