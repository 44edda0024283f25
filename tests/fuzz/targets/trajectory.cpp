// A trajectory (CSV).
#include "renderer/trajectory/trajectory.h"

#include <cmath>

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const auto rows = read_trajectory(folder.write("t.csv", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(rows))) return fuzz::require(!rows.error().what.empty(), "an error has words"), 0;
    for (const TrajectoryRow& row : *rows) {
        fuzz::require(is_finite(row.motion.T_world_body.t), "a position is finite");
        fuzz::require(std::abs(norm(row.motion.T_world_body.q) - 1) < 1e-9, "an attitude is unit");
    }
    return 0;
}
