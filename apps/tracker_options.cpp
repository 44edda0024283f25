#include "apps/tracker_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace narpa::cli {

void TrackerFlags::add_to(Parser app, const std::string& prefix) {
    const std::string dashes = "--" + prefix;
    app.option(dashes + "target", tracker.target,
               "Body whose pose is estimated (default: the first with a mesh that does not carry the camera)");
    app.option(dashes + "method", method,
               "features: points of the frame and of a render; dense: all pixels, starting from the features' pose")
        .one_of({"features", "dense"})
        .shows_default();
    app.option(dashes + "start", start,
               "DEG,PERCENT: error of the first guess, in attitude and as a part of the range")
        .shows_default();
    app.option(dashes + "seed", tracker.seed, "Seed of the first guess and of the renders").shows_default();
}

Result<TrackerOptions> TrackerFlags::options() const {
    TrackerOptions o = tracker;
    double deg = 0, percent = 0;
    int used = 0;
    const bool read = std::sscanf(start.c_str(), "%lf,%lf%n", &deg, &percent, &used) == 2 &&
                      used == static_cast<int>(start.size());
    if (!read || !(deg >= 0 && deg <= 180) || !(percent >= 0 && percent <= 100))
        return Error{fmt::format("start \"{}\", expected DEG,PERCENT from 0,0 to 180,100, like 5,5", start)};
    o.start_deg = deg, o.start_percent = percent;
    o.method = method == "dense" ? EstimateMethod::dense : EstimateMethod::features;
    return o;
}

}  // namespace narpa::cli
