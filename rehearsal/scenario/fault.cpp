#include "rehearsal/scenario/fault.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <vector>

#include "base/constants.h"
#include "rehearsal/scenario/scenario_tables.h"

namespace narpa::rehearsal {
namespace {

constexpr std::array<FaultKind, 6> kKinds{{
    {"thruster_off", "axis", "thruster off", "the group of thrusters `axis` does not fire", false,
     [](const Fault& f, FaultEffects& e) { e.off[f.group()] = true; }},
    {"thruster_stuck", "axis", "thruster stuck", "the group of thrusters `axis` fires all the time", false,
     [](const Fault& f, FaultEffects& e) { e.stuck[f.group()] = true; }},
    {"attitude_bias", "value", "attitude sensor turned", "the attitude sensor is turned by `value` (deg)", false,
     [](const Fault& f, FaultEffects& e) {
         e.q_attitude_bias = e.q_attitude_bias * exp_rotation(kDegree * f.value);
     }},
    {"target_rate", "value", "target's rate changed", "the target's rate is changed by `value` (deg/s)", false,
     [](const Fault& f, FaultEffects& e) { e.target_rate_rad_s += kDegree * f.value; }},
    {"commands_lost", "", "thruster commands lost", "no actuator command is delivered", false,
     [](const Fault&, FaultEffects& e) { e.commands_lost = true; }},
    {"throttle_stuck", "", "throttle stuck", "the engine gives its smallest force whenever it burns", true,
     [](const Fault&, FaultEffects& e) { e.throttle_stuck = true; }},
}};

constexpr TableKey kFaultRows[]{
    {"kind", rows::kind(), "what goes wrong"},
    {"from_s", rows::number(kNotNegative)},
    {"until_s", rows::number(kPositive)},
};
constexpr TableKey kOwnRows[]{
    {"axis", rows::choice<kThrusterGroupNames>(), "\"+fx\", \"-fx\" ... \"+tz\", \"-tz\": a group of thrusters",
     "belongs to faults of thrusters"},
    {"value", rows::vec3({.low = -360, .high = 360}), "[x, y, z]", "belongs to attitude_bias and target_rate"},
};

std::vector<TableKind> kinds_of_faults() {
    std::vector<TableKind> kinds;
    for (const FaultKind& kind : kKinds) {
        kinds.push_back({kind.name});
        for (const TableKey& row : kOwnRows)
            if (row.name == kind.key) kinds.back().rows = {&row, 1};
    }
    return kinds;
}

Fault read_fault(TableReader& table, const Scenario& s) {
    Fault fault;
    fault.kind = &kKinds[table.kind().value_or(0)];
    table.read("from_s", fault.from_s);
    table.read("until_s", fault.until_s);
    if (!(fault.from_s < s.duration_s))
        table.fail("from_s", fmt::format("is {:g}, expected less than duration_s of [scenario], {:g}", fault.from_s,
                                         s.duration_s));
    if (!(fault.until_s > fault.from_s))
        table.fail("until_s", fmt::format("is {:g}, expected more than from_s, {:g}", fault.until_s, fault.from_s));
    if (fault.kind->needs_engine && !s.engine)
        table.fail("kind", "there is no throttle, expected a table [engine]");
    if (fault.kind->key == "axis") {
        table.read("axis", fault.axis);
        if (table.has("axis") && std::ranges::find(kThrusterGroupNames, fault.axis) == kThrusterGroupNames.end())
            table.fail("axis", fmt::format("\"{}\" is no group of thrusters, expected one of {}", fault.axis,
                                           fmt::join(kThrusterGroupNames, ", ")));
    } else if (fault.kind->key == "value") {
        table.read("value", fault.value);
    }
    table.finish();
    return fault;
}

}  // namespace

constinit const TableKeys kFaultKeys{.rows = kFaultRows, .kinds = kinds_of_faults};

std::span<const FaultKind> fault_kinds() {
    return kKinds;
}

const FaultKind* fault_kind(std::string_view name) {
    const auto kind = std::ranges::find(kKinds, name, &FaultKind::name);
    return kind == kKinds.end() ? nullptr : &*kind;
}

std::size_t Fault::group() const {
    const auto at = std::ranges::find(kThrusterGroupNames, axis);
    assert(at != kThrusterGroupNames.end());
    return static_cast<std::size_t>(at - kThrusterGroupNames.begin());
}

FaultEffects effects_at(std::span<const Fault> faults, std::int64_t t_ns) {
    FaultEffects effects;
    for (const Fault& f : faults)
        if (t_ns >= to_ns(f.from_s) && t_ns < to_ns(f.until_s)) f.kind->act(f, effects);
    return effects;
}

std::int64_t next_change_ns(std::span<const Fault> faults, std::int64_t t_ns) {
    std::int64_t next = std::numeric_limits<std::int64_t>::max();
    for (const Fault& f : faults)
        for (const std::int64_t at : {to_ns(f.from_s), to_ns(f.until_s)})
            if (at > t_ns) next = std::min(next, at);
    return next;
}

void read_faults(TableReader& root, Scenario& s) {
    for (TableReader& table : root.tables("fault")) s.faults.push_back(read_fault(table, s));
}

}  // namespace narpa::rehearsal
