/// rehearsal/dynamics/flight_log.h - log files of the true motion: truth.csv and dynamics.json.
#pragma once

#include <cstdint>
#include <fstream>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/result.h"
#include "rehearsal/dynamics/simulation.h"

namespace narpa::rehearsal {

/// truth.csv: a row at each pose command. Port state with angles in degrees; impulses since the row before,
/// chaser's body axes.
class TruthLog {
public:
    static Result<TruthLog> create(const std::string& folder);
    void append(const Simulation& simulation);
    /// An Error if not everything could be written.
    Status close();

private:
    TruthLog(std::string path, std::ofstream file) : path_(std::move(path)), file_(std::move(file)) {}

    std::string path_;
    std::ofstream file_;
    Loads fired_{};
};

/// Random draws and ending, for dynamics.json.
[[nodiscard]] nlohmann::json summary(const Simulation& simulation, const Scenario& scenario, std::uint64_t seed);

}  // namespace narpa::rehearsal
