#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "bench/pnp.h"

namespace narpa {
namespace {

bool is_nominal(const PnpCell& cell) {
    return cell.name == "nominal" && cell.outliers == 0;
}

/// More failures by three standard deviations of what chance makes of equal solvers.
bool fails_more(const PnpRow& ours, const PnpRow& theirs) {
    const double pooled = 0.5 * (ours.failed + theirs.failed), n = ours.trials;
    return ours.failed - theirs.failed > 3 * std::sqrt(2 * pooled * (1 - pooled) / n);
}

}  // namespace

PnpVerdict judge(const std::vector<PnpCell>& cells) {
    PnpVerdict v;
    for (const PnpCell& cell : cells) {
        const PnpRow *cold = cell.row(kPnpCold), *warm = cell.row(kPnpWarm);
        if (const PnpRow* peer = cell.row(kPnpPeerCold)) {
            v.more_failures += fails_more(*cold, *peer) ? 1 : 0;
            if (is_nominal(cell))
                v.cold_time_ratio = std::max(v.cold_time_ratio, cold->median_us / peer->median_us);
        }
        if (const PnpRow* peer = cell.row(kPnpPeerWarm); peer != nullptr && is_nominal(cell))
            v.warm_time_ratio = std::max(v.warm_time_ratio, warm->median_us / peer->median_us);
        if (const PnpRow* peer = cell.row(kPnpPeerOutliers); peer != nullptr && cell.outliers <= 0.2)
            v.outlier_time_ratio = std::max(v.outlier_time_ratio, cold->median_us / peer->median_us);
        if (is_nominal(cell) && cell.points >= 10)
            v.worst_rms = std::max({v.worst_rms, cold->rotation_rms, cold->position_rms});
    }
    return v;
}

std::string in_words(const std::vector<PnpCell>& cells) {
    std::string out = fmt::format("{:<24} {:>13} {:>13} {:>9} {:>9} {:>9}\n", "", "rotation", "position", "failed",
                                  "flagged", "time");
    out += fmt::format("{:<24} {:>6} {:>6} {:>6} {:>6} {:>9} {:>9} {:>9}\n", "in units of the bound", "median",
                       "rms", "median", "rms", "%", "% of them", "us");
    for (const PnpCell& cell : cells) {
        out += fmt::format("{}, {} points, {:g} px, {:g} m{}: bound {:.3g} deg, {:.3g} % of the range\n", cell.name,
                           cell.points, cell.noise_px, cell.range_m,
                           cell.outliers > 0 ? fmt::format(", {:g} % outliers", 100 * cell.outliers) : "",
                           cell.bound_rotation_deg, 100 * cell.bound_position);
        for (const PnpRow& r : cell.rows)
            out += fmt::format("  {:<22} {:>6.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>9.2f} {:>9.0f} {:>9.1f}\n",
                               r.method, r.rotation_median, r.rotation_rms, r.position_median, r.position_rms,
                               100 * r.failed, 100 * r.flagged, r.median_us);
    }
    return out;
}

std::string in_words(const PnpVerdict& v) {
    return fmt::format(
        "points: worst RMS {:.3f} bounds from ten points up; {} cells with more failures than {}; time: cold "
        "{:.2f} "
        "of {}, warm {:.2f} of {}, outliers {:.2f} of {}\n",
        v.worst_rms, v.more_failures, kPnpPeerCold, v.cold_time_ratio, kPnpPeerCold, v.warm_time_ratio,
        kPnpPeerWarm, v.outlier_time_ratio, kPnpPeerOutliers);
}

nlohmann::json to_json(const std::vector<PnpCell>& cells) {
    nlohmann::json all = nlohmann::json::array();
    for (const PnpCell& cell : cells) {
        nlohmann::json rows = nlohmann::json::array();
        for (const PnpRow& r : cell.rows)
            rows.push_back({{"method", r.method},
                            {"trials", r.trials},
                            {"rotation_median_bounds", r.rotation_median},
                            {"rotation_rms_bounds", r.rotation_rms},
                            {"position_median_bounds", r.position_median},
                            {"position_rms_bounds", r.position_rms},
                            {"failed", r.failed},
                            {"flagged", r.flagged},
                            {"median_us", r.median_us}});
        all.push_back({{"name", cell.name},
                       {"points", cell.points},
                       {"noise_px", cell.noise_px},
                       {"range_m", cell.range_m},
                       {"outliers", cell.outliers},
                       {"bound_rotation_deg", cell.bound_rotation_deg},
                       {"bound_position_of_range", cell.bound_position},
                       {"rows", rows}});
    }
    return all;
}

nlohmann::json to_json(const PnpVerdict& v) {
    return {{"worst_rms_bounds", v.worst_rms},
            {"cells_with_more_failures", v.more_failures},
            {"cold_time_ratio", v.cold_time_ratio},
            {"warm_time_ratio", v.warm_time_ratio},
            {"outlier_time_ratio", v.outlier_time_ratio}};
}

}  // namespace narpa
