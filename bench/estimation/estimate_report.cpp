// The reports of the estimator benches: a JSON document and a table for each. One file, because JSON and fmt are
// slow to compile.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/estimation/approach.h"
#include "bench/estimation/consistency.h"
#include "bench/estimation/filter.h"
#include "bench/estimation/icp.h"
#include "bench/estimation/pnp.h"
#include "bench/estimation/stereo.h"
#include "bench/statistics.h"
#include "tracking/estimate_report.h"

namespace narpa {
namespace {

using nlohmann::json;

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

}  // namespace

// JSON keys are the members' names. Infinity becomes null.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PnpRow, method, trials, rotation_median_bounds, rotation_rms_bounds,
                                   position_median_bounds, position_rms_bounds, failed, flagged, median_us)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PnpCell, name, points, noise_px, range_m, outliers, bound_rotation_deg,
                                   bound_position_of_range, rows)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PnpVerdict, worst_rms_bounds, cells_with_more_failures, cold_time_ratio,
                                   warm_time_ratio, outlier_time_ratio)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ApproachBand, from_m, to_m, frames, found, wrong, rotation_rms_rad,
                                   position_rms_m, rotation_of_bound, position_of_bound, nees_median, ms_median,
                                   renders_mean)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(BasinCell, off_deg_and_percent, trials, found)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ApproachFrame, range_m, found, claimed, why, rotation_rad, position_m,
                                   bound_rotation_rad, bound_position_m, nees, ms, renders)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(StereoCounts, accepted, cut_off, unlike, ambiguous, inconsistent, unsettled,
                                   off_line, without_depth)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Spread, median, lower_quartile, upper_quartile, whiskers, outliers, largest, rms)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(IcpRun, start_angle_deg, start_distance_fraction, starts, found, told,
                                   unobserved, rotation_rms_deg, translation_rms_m, rotation_to_bound,
                                   translation_to_bound, nees, points, iterations, microseconds_p50,
                                   microseconds_p99)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(FilterTime, t_s, nees, position_rms_m, position_sigma_m, attitude_rms_rad,
                                   attitude_sigma_rad)

// Poses from points

std::string to_text(const std::vector<PnpCell>& cells) {
    std::string out = fmt::format("{:<24} {:>13} {:>13} {:>9} {:>9} {:>9}\n", "", "rotation", "position", "failed",
                                  "flagged", "time");
    out += fmt::format("{:<24} {:>6} {:>6} {:>6} {:>6} {:>9} {:>9} {:>9}\n", "in units of the bound", "median",
                       "rms", "median", "rms", "%", "% of them", "us");
    for (const PnpCell& cell : cells) {
        out += fmt::format("{}, {} points, {:g} px, {:g} m{}: bound {:.3g} deg, {:.3g} % of the range\n", cell.name,
                           cell.points, cell.noise_px, cell.range_m,
                           cell.outliers > 0 ? fmt::format(", {:g} % outliers", 100 * cell.outliers) : "",
                           cell.bound_rotation_deg, 100 * cell.bound_position_of_range);
        for (const PnpRow& r : cell.rows)
            out += fmt::format("  {:<22} {:>6.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>9.2f} {:>9.0f} {:>9.1f}\n",
                               r.method, r.rotation_median_bounds, r.rotation_rms_bounds, r.position_median_bounds,
                               r.position_rms_bounds, 100 * r.failed, 100 * r.flagged, r.median_us);
    }
    return out;
}

std::string to_text(const PnpVerdict& v) {
    return fmt::format(
        "points: worst RMS {:.3f} bounds from ten points up; {} cells with more failures than {}; time: cold "
        "{:.2f} "
        "of {}, warm {:.2f} of {}, outliers {:.2f} of {}\n",
        v.worst_rms_bounds, v.cells_with_more_failures, kPnpPeerCold, v.cold_time_ratio, kPnpPeerCold,
        v.warm_time_ratio, kPnpPeerWarm, v.outlier_time_ratio, kPnpPeerOutliers);
}

json to_json(const std::vector<PnpCell>& cells) {
    return json(cells);
}

json to_json(const PnpVerdict& v) {
    return json(v);
}

// Approach

json to_json(const std::vector<ApproachRun>& runs) {
    json all = json::array();
    for (const ApproachRun& run : runs)
        all.push_back(
            {{"method", run.method->name}, {"bands", run.bands}, {"basin", run.basin}, {"frames", run.frames}});
    return all;
}

std::string to_text(const std::vector<ApproachRun>& runs) {
    std::string out =
        fmt::format("{:<10} {:>14} {:>9} {:>6} {:>11} {:>11} {:>15} {:>6} {:>8} {:>8}\n", "approach", "range, m",
                    "found", "wrong", "RMS deg", "RMS m", "/ bound", "NEES", "renders", "ms");
    for (const ApproachRun& run : runs) {
        for (const ApproachBand& b : run.bands) {
            const bool all = !std::isfinite(b.from_m) && b.to_m == 0;
            const std::string range = all                       ? "all"
                                      : std::isfinite(b.from_m) ? fmt::format("{:g} .. {:g}", b.from_m, b.to_m)
                                                                : fmt::format("beyond {:g}", b.to_m);
            out += fmt::format(
                "{:<10} {:>14} {:>4}/{:<4} {:>6} {:>11.4f} {:>11.3g} {:>7.2f} {:>7.2f} {:>6.1f} {:>8.1f} "
                "{:>8.0f}\n",
                run.method->name, range, b.found, b.frames, b.wrong, b.rotation_rms_rad / kDegree, b.position_rms_m,
                b.rotation_of_bound, b.position_of_bound, b.nees_median, b.renders_mean, b.ms_median);
        }
        if (run.basin.empty()) continue;
        out += fmt::format("{:<10} found from starts off by", run.method->name);
        for (const BasinCell& c : run.basin)
            out += fmt::format("  {:g}: {}/{}", c.off_deg_and_percent, c.found, c.trials);
        out += " (degrees and % of the range)\n";
    }
    return out;
}

// Stereo

json to_json(const StereoBench& bench) {
    json out{{"scene", bench.scene},
             {"points", bench.points.size()},
             {"gain", bench.gain()},
             {"mean_normalised_squared", bench.mean_normalised_squared()},
             {"mean_epipolar_squared", bench.mean_epipolar_squared()},
             {"render_s", bench.render_s},
             {"match_s", bench.match_s}};
    for (const bool fine : {false, true})
        for (int axis = 0; axis < 3; ++axis) {
            json& at = out[fine ? "between_pixels" : "whole_pixels"][kAxes[static_cast<std::size_t>(axis)]];
            at["absolute_m"] = bench.errors(fine, axis, false);
            at["over_range"] = bench.errors(fine, axis, true);
        }
    out["corners"] = bench.counts;
    return out;
}

std::string to_text(const StereoBench& bench) {
    std::string out =
        fmt::format("{:<16} {:>4} {:>10} {:>10} {:>10} {:>10} {:>10} {:>9} {:>14}\n", "matching", "axis",
                    "median m", "quartiles", "", "largest m", "RMS m", "outliers", "RMS/range %");
    for (const bool fine : {false, true})
        for (int axis = 0; axis < 3; ++axis) {
            const Spread s = bench.errors(fine, axis, false);
            out += fmt::format("{:<16} {:>4} {:>10.4f} {:>10.4f} {:>10.4f} {:>10.4f} {:>10.4f} {:>9} {:>14.5f}\n",
                               fine ? "between pixels" : "whole pixels", kAxes[static_cast<std::size_t>(axis)],
                               s.median, s.lower_quartile, s.upper_quartile, s.largest, s.rms, s.outliers,
                               100 * bench.errors(fine, axis, true).rms);
        }
    out += fmt::format(
        "{} points; depth over range {:.1f} times better between pixels; squared errors over predicted "
        "variance: depth {:.2f}, across the epipolar line {:.2f}\n",
        bench.points.size(), bench.gain(), bench.mean_normalised_squared(), bench.mean_epipolar_squared());
    return out;
}

// ICP

json to_json(const std::vector<IcpRun>& runs) {
    return json(runs);
}

std::string to_text(const std::vector<IcpRun>& runs) {
    std::string text =
        "start deg      %  starts   found  silent  unseen  rot mdeg    mm  to bound: rot, trans  nees"
        "  points  steps   us p50      p99\n";
    for (const IcpRun& r : runs)
        text += fmt::format(
            "{:9.1f} {:6.1f} {:7} {:6.1f}% {:7} {:7} {:9.1f} {:5.1f} {:14.2f} {:6.2f} {:5.2f} {:7.0f} {:6.1f} "
            "{:8.0f} {:8.0f}\n",
            r.start_angle_deg, 100 * r.start_distance_fraction, r.starts, 100 * r.found_fraction(),
            r.starts - r.found - r.told, r.unobserved, 1e3 * r.rotation_rms_deg, 1e3 * r.translation_rms_m,
            r.rotation_to_bound, r.translation_to_bound, r.nees, r.points, r.iterations, r.microseconds_p50,
            r.microseconds_p99);
    return text;
}

// Filter

json to_json(const std::vector<FilterRun>& runs) {
    json all = json::array();
    for (const FilterRun& r : runs)
        all.push_back({{"name", r.name},
                       {"runs", r.runs},
                       {"nees", r.nees()},
                       {"band", {kFilterStates - r.band(), kFilterStates + r.band()}},
                       {"inside_band", r.inside_band()},
                       {"nis", r.nis},
                       {"updates", r.updates},
                       {"gated", r.gated},
                       {"update_microseconds", r.update_microseconds},
                       {"times", r.times}});
    return all;
}

std::string to_text(const std::vector<FilterRun>& runs) {
    std::string text =
        fmt::format("{:<40} {:>5} {:>6} {:>13} {:>7} {:>6} {:>6} {:>20} {:>22} {:>7}\n", "case", "runs", "NEES",
                    "band", "inside", "NIS", "gated", "last mm: rms, sigma", "last mrad: rms, sigma", "us");
    for (const FilterRun& r : runs) {
        const FilterTime& last = r.times.back();
        text += fmt::format(
            "{:<40} {:5} {:6.2f} {:6.2f}-{:5.2f} {:6.0f}% {:6.2f} {:6} {:12.2f} {:7.2f} {:14.3f} {:7.3f} "
            "{:7.1f}\n",
            r.name, r.runs, r.nees(), kFilterStates - r.band(), kFilterStates + r.band(), 100 * r.inside_band(),
            r.nis, r.gated, 1e3 * last.position_rms_m, 1e3 * last.position_sigma_m, 1e3 * last.attitude_rms_rad,
            1e3 * last.attitude_sigma_rad, r.update_microseconds);
    }
    return text;
}

// Consistency

json to_json(const std::vector<ConsistencyRow>& rows) {
    json all = json::array();
    for (const ConsistencyRow& r : rows) {
        json answers;
        for (std::size_t i = 0; i < kAnswerKinds.size(); ++i) answers[std::string(kAnswerKinds[i])] = r.answers[i];
        all.push_back({{"method", r.method},
                       {"target", r.target},
                       {"condition", r.condition},
                       {"answers", answers},
                       {"good_beyond_six_sigma", r.beyond},
                       {"beyond_trials", r.beyond_trials},
                       {"nees", r.nees},
                       {"rotation_rad", r.rotation_rad},
                       {"position_of_range", r.position_of_range}});
    }
    return all;
}

std::string to_text(const std::vector<ConsistencyRow>& rows) {
    std::string out =
        fmt::format("{:<30} {:>7} {:>6} {:>6} {:>6} {:>7} {:>7} {:>7} {:>7} {:>9} {:>9}\n", "", "trials", "good",
                    "ambig.", "unobs.", "refused", "beyond", "NEES", "median", "RMS deg", "% range");
    const auto line = [&](const std::string& name, const ConsistencyRow& r) {
        Mean nees, turn, shift;
        for (const double v : r.nees) nees.add(std::min(v, kSixSigmaNees));
        for (const double v : r.rotation_rad) turn.add(v);
        for (const double v : r.position_of_range) shift.add(v);
        out += fmt::format("{:<30} {:>7} {:>6} {:>6} {:>6} {:>7} {:>7} {:>7.2f} {:>7.2f} {:>9.4f} {:>9.4f}\n", name,
                           r.trials(), r.answers[0], r.answers[1], r.answers[2], r.answers[3], r.beyond,
                           nees.mean(), quantile(r.nees, 0.5), turn.rms() / kDegree, 100 * shift.rms());
    };
    using GroupKey = std::function<std::string(const ConsistencyRow&)>;
    for (const GroupKey& key : {GroupKey([](const ConsistencyRow& r) { return r.method; }),
                                GroupKey([](const ConsistencyRow& r) { return r.method + ", " + r.target; }),
                                GroupKey([](const ConsistencyRow& r) { return r.method + ", " + r.condition; })}) {
        std::map<std::string, ConsistencyRow> sums;
        for (const ConsistencyRow& r : rows) sums[key(r)].add(r);
        for (const auto& [name, sum] : sums) line(name, sum);
    }
    return out;
}

}  // namespace narpa
