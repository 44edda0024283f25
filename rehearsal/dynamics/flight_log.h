/// rehearsal/dynamics/flight_log.h - what really happened, in files: truth.csv and dynamics.json.
#pragma once

#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "base/result.h"
#include "rehearsal/dynamics/simulation.h"

namespace narpa::rehearsal {

/// truth.csv: a row at each pose command. Ports as in PortState, but degrees; impulses: fired since the row
/// before, chaser's body axes.
class TruthLog {
public:
    static Result<TruthLog> create(const std::string& folder);
    void append(const Simulation& simulation);
    /// An Error where not all of it could be written.
    Status close();

private:
    TruthLog(std::string path, std::ofstream file) : path_(std::move(path)), file_(std::move(file)) {}

    std::string path_;
    std::ofstream file_;
    Loads fired_{};
};

/// What was drawn, and how it ended: of dynamics.json.
[[nodiscard]] nlohmann::json summary(const Simulation& simulation, const Scenario& scenario, std::uint64_t seed);

}  // namespace narpa::rehearsal
