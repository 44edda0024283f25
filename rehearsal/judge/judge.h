/// rehearsal/judge/judge.h - judges a rehearsal by the messages on its bus.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

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

class Judge;
/// A kind of requirement. What is judged is one of: a limit on every pose (`margin_m`); `judge`; with neither, each
/// of the conditions of a landing, as a gate of its own.
struct GateKind {
    std::string_view name;  ///< in results
    std::string_view unit;  ///< of the margin
    std::string_view key;   ///< in [gates]; empty: none
    std::string_view text;  ///< for documents
    bool (*is_asked)(const Gates&);
    void (Judge::*judge)(GateResult&) const = nullptr;

    /// Negative: violated; empty: not judged at this pose.
    std::optional<double> (*margin_m)(const Gates&, const TruthState&) = nullptr;
    std::string (*asked)(const Gates&) = nullptr;
    std::string (*pose_text)(const Gates&, const TruthState&) = nullptr;
    std::string (*not_judged)(const Gates&) = nullptr;  ///< why it was judged at no pose
};

/// "leg 2 \"hold\"", for a leg index as in the commands.
[[nodiscard]] std::string leg_text(const Scenario& scenario, std::size_t leg);

/// Computes a verdict from CAN frames. The scenario and the bus are its only inputs: a log gives the same verdict
/// as the live bus.
///
/// After capture the two are one body: corridor, distances and estimates are judged up to that time. A lander is
/// judged up to its touchdown, and then by the ground that it stands on, for which the scene is read.
class Judge {
public:
    using Failure = std::function<void(const GateResult&)>;

    static constexpr std::size_t kGateKinds = 8;
    /// In the order of a verdict.
    [[nodiscard]] static std::span<const GateKind, kGateKinds> gate_kinds();

    /// `on_failure` is called for each gate as soon as it has failed.
    explicit Judge(const Scenario& scenario, Failure on_failure = {});

    /// `t_reference_ns`: a time within 39 h of the simulation clock, as a log's stamp.
    void accept(const CanFrame& frame, std::int64_t t_reference_ns);
    /// The verdict on all frames so far. `trouble`: what ended the run, if that is not on the bus; it fails the
    /// run.
    [[nodiscard]] Verdict finish(const std::string& trouble = {}) const;

    [[nodiscard]] const BusRecord& bus() const { return bus_; }
    /// True if the dynamics have reported the end.
    [[nodiscard]] bool finished() const { return bus_.first_report(DynamicsPhase::finished) != nullptr; }
    /// "the navigation sent nothing; last received: ...": the program whose message is due next.
    [[nodiscard]] std::string awaited() const;
    /// Gates that have failed so far.
    [[nodiscard]] std::size_t failures() const { return failures_; }

private:
    void check(const TruthState& state);
    void check(const JudgedEstimate& estimate);
    void check(const DynamicsReport& report);
    void report(const GateResult& result);
    void report(std::string_view gate);  ///< if it has failed

    [[nodiscard]] GateResult result(const GateKind& kind) const;
    void judge_poses(const GateKind& kind, GateResult& gate) const;
    void judge_navigation(GateResult& gate) const;
    void judge_contact(GateResult& gate) const;
    void judge_complete(GateResult& gate) const;
    void judge_duration(GateResult& gate) const;
    [[nodiscard]] GateResult landing(const Contact& touchdown, const ContactCondition& condition,
                                     bool of_touchdown) const;
    void add_landing_gates(Verdict& verdict) const;
    [[nodiscard]] std::optional<Footing> footing_at_end() const;
    [[nodiscard]] std::optional<Contact> contact_made() const;
    [[nodiscard]] NavigationStatistics navigation_statistics() const;
    [[nodiscard]] LedgerStatistics ledger_statistics() const;
    void set_headline(Verdict& verdict, const std::string& trouble) const;

    const Scenario scenario_;
    const Failure on_failure_;
    BusRecord bus_{scenario_};
    std::size_t failures_ = 0;
    std::optional<std::int64_t> t_captured_ns_;     ///< or landed
    std::optional<std::int64_t> t_contact_ns_;      ///< captured, bounced or touched down, whichever came first
    std::optional<std::int64_t> t_last_judged_ns_;  ///< motion is judged up to this time
    bool abort_reported_ = false, contact_judged_ = false, measured_ = false;

    std::array<LimitMonitor<TruthState>, kGateKinds> poses_;  ///< of each kind with `margin_m`
    LimitMonitor<JudgedEstimate> position_, attitude_,
        sigmas_;  ///< largest errors, and those in standard deviations for the gate
};

/// Passes all frames of a candump log to the judge.
Status accept_log(Judge& judge, const std::string& path);

}  // namespace narpa::rehearsal
