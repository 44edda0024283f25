/// renderer/trajectory/state_table.h - positions and attitudes from a CSV whose columns a trajectory file
/// names.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "renderer/ephemeris/time_systems.h"
#include "renderer/trajectory/sampled_course.h"

namespace narpa {

/// Names of columns, and what is in them.
struct StateTable {
    enum class Frame : std::uint8_t { world, icrf, eme2000 };
    struct Time {
        std::string column;
        double unit_s = 1;                   ///< of the time since the epoch
        std::optional<TimeSystem> system{};  ///< of calendar times
    };
    struct Vectors {
        std::array<std::string, 3> columns;
        double unit = 1;  ///< m, or m/s
    };
    struct Attitudes {
        std::array<std::string, 4> columns;
        bool scalar_first = true;
        bool body_to_frame = true;
    };

    std::string file;
    Time time;
    Frame frame{};
    std::optional<Vectors> position{}, velocity{};
    std::optional<Attitudes> attitude{};
};

struct TableCourses {
    std::optional<SampledCourse> position{}, attitude{};
};

/// A header line with the names, then rows whose times increase; cells as in other CSV files (base/text/csv.h).
/// `epoch_ns`: TAI since 2000. An interpolation is needed for what the table has. Errors name file, line and
/// column.
Result<TableCourses> read_state_table(const StateTable& table, std::int64_t epoch_ns,
                                      const std::optional<Interpolation>& of_position,
                                      const std::optional<Interpolation>& of_attitude);

}  // namespace narpa
