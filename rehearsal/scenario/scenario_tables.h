/// rehearsal/scenario/scenario_tables.h - values and tables of scenario files.
#pragma once

#include <string_view>

#include "rehearsal/scenario/scenario.h"
#include "renderer/keys/toml_reader.h"

namespace narpa::rehearsal {

/// Sets `value` if the table has the key.
inline void read(TableReader& table, std::string_view key, double& value, const Range& range = kAnyNumber) {
    value = table.number(key, range).value_or(value);
}
inline void read(TableReader& table, std::string_view key, Vec3& value, const Range& range = kAnyNumber) {
    value = table.vec3(key, range).value_or(value);
}
inline void read(TableReader& table, std::string_view key, bool& value) {
    value = table.boolean(key).value_or(value);
}

// The tables of landings.

[[nodiscard]] Engine read_engine(TableReader& table);
[[nodiscard]] LandingGear read_gear(TableReader& table, const Scenario& s);
/// `gates` may lack the table.
void read_landing(TableReader& gates, const Scenario& s, Gates& out);

}  // namespace narpa::rehearsal
