// A trajectory (CSV), or an orbit or attitude ephemeris.
#include "renderer/trajectory/trajectory.h"

#include <cmath>

#include "renderer/trajectory/ccsds_message.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const std::string file = folder.write("t.csv", fuzz::text_of(data, size));
    if (const std::string_view format = format_of_poses(file); format == "OEM" || format == "AEM") {
        const auto course = format == "OEM" ? read_oem(file, std::nullopt) : read_aem(file, std::nullopt);
        if (!fuzz::count(bool(course)))
            return fuzz::require(course.error().file == file, "an error names the file"), 0;
        fuzz::require(course->at(course->from_ns()).has_value(), "there is data at the beginning");
        return 0;
    }
    const auto rows = read_trajectory(file);
    if (!fuzz::count(bool(rows))) return fuzz::require(!rows.error().what.empty(), "an error has words"), 0;
    for (const TrajectoryRow& row : *rows) {
        fuzz::require(is_finite(row.motion.T_world_body.t), "a position is finite");
        fuzz::require(std::abs(norm(row.motion.T_world_body.q) - 1) < 1e-9, "an attitude is unit");
    }
    return 0;
}
