#include "emulator/log/estimate_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "plot/plot.h"

namespace narpa {
namespace {

constexpr int kFreedom = 6;

double rotation(const Vector6& error) {
    return error.head<3>().norm();
}
double position(const Vector6& error) {
    return error.tail<3>().norm();
}
/// RMS of what is added.
struct Squares {
    double sum = 0;
    std::size_t n = 0;
    void add(double v) { sum += v * v, ++n; }
    [[nodiscard]] double rms() const { return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0; }
};

}  // namespace

std::string estimate_row(const TrackedFrame& f) {
    std::string row = fmt::format("{},{},{},", f.frame, f.t_ns, kEstimateStates[static_cast<std::size_t>(f.state)]);
    if (f.measured) {
        const Rigid3& T = *f.measured;
        row += fmt::format("{},{},{},{},{},{},{},", T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z);
        for (int i = 0; i < kFreedom; ++i) row += fmt::format("{:.6g},", std::sqrt(f.covariance(i, i)));
        const Vector6 error = error_between(T, f.truth);
        row += fmt::format("{:.6g},{:.6g},", rotation(error), position(error));
    } else {
        row += ",,,,,,,,,,,,,,,";
    }
    if (f.state != EstimateState::lost) {
        const Vector6 error = error_between(f.filtered, f.truth);
        row += fmt::format("{:.6g},{:.6g},", rotation(error), position(error));
    } else {
        row += ",,";
    }
    if (f.measured)
        row += fmt::format("{:.6g},{:.6g},{:.6g},{:.6g},",
                           normalised_error_squared(error_between(*f.measured, f.truth), f.covariance), f.nis,
                           rotation_sigma(f.bound), position_sigma(f.bound));
    else
        row += ",,,,";
    std::string why = f.why;  // one field
    std::replace(why.begin(), why.end(), ',', ';');
    return row + fmt::format("{},{},{:.3f},{}\n", f.matches, f.renders, f.ms, why);
}

EstimateSummary summarise(std::span<const TrackedFrame> frames) {
    EstimateSummary s;
    s.frames = frames.size();
    Squares turn, shift, part, filtered_turn, filtered_shift, turn_of_bound, shift_of_bound;
    double nees = 0, nis = 0;
    std::size_t told = 0, compared = 0;
    std::vector<double> ms;
    for (const TrackedFrame& f : frames) {
        ms.push_back(f.ms);
        if (f.state != EstimateState::lost) {
            const Vector6 error = error_between(f.filtered, f.truth);
            filtered_turn.add(rotation(error)), filtered_shift.add(position(error));
        }
        if (f.state != EstimateState::measured || !f.measured) continue;
        if (f.nis > 0) nis += f.nis, ++compared;
        ++s.measured;
        const Vector6 error = error_between(*f.measured, f.truth);
        turn.add(rotation(error)), shift.add(position(error)), part.add(position(error) / norm(f.truth.t));
        if (const double square = normalised_error_squared(error, f.covariance); std::isfinite(square))
            nees += square, ++told;
        if (f.bound.topLeftCorner<3, 3>().trace() > 0) {
            turn_of_bound.add(rotation(error) / rotation_sigma(f.bound));
            shift_of_bound.add(position(error) / position_sigma(f.bound));
        }
    }
    s.rotation_rms_rad = turn.rms(), s.position_rms_m = shift.rms(), s.position_rms_of_range = part.rms();
    s.filtered_rotation_rms_rad = filtered_turn.rms(), s.filtered_position_rms_m = filtered_shift.rms();
    s.rotation_of_bound = turn_of_bound.rms(), s.position_of_bound = shift_of_bound.rms();
    if (told > 0) {
        s.nees_mean = nees / static_cast<double>(told);
        const double half = 1.96 * std::sqrt(2.0 * kFreedom / static_cast<double>(told));  // of chi-square
        s.nees_low = std::max(0.0, kFreedom - half), s.nees_high = kFreedom + half;
    }
    if (compared > 0) s.nis_mean = nis / static_cast<double>(compared);
    if (!ms.empty()) {
        const auto middle = ms.begin() + static_cast<std::ptrdiff_t>(ms.size() / 2);
        std::nth_element(ms.begin(), middle, ms.end());
        s.ms_median = *middle;
        s.ms_most = *std::max_element(ms.begin(), ms.end());
    }
    return s;
}

nlohmann::json to_json(const EstimateSummary& s) {
    return {{"frames", s.frames},
            {"measured", s.measured},
            {"rotation_rms_rad", s.rotation_rms_rad},
            {"position_rms_m", s.position_rms_m},
            {"position_rms_of_range", s.position_rms_of_range},
            {"filtered_rotation_rms_rad", s.filtered_rotation_rms_rad},
            {"filtered_position_rms_m", s.filtered_position_rms_m},
            {"nees_mean", s.nees_mean},
            {"nees_95", {s.nees_low, s.nees_high}},
            {"nis_mean", s.nis_mean},
            {"rotation_of_bound", s.rotation_of_bound},
            {"position_of_bound", s.position_of_bound},
            {"ms_median", s.ms_median},
            {"ms_most", s.ms_most}};
}

std::string in_words(const EstimateSummary& s) {
    std::string out = fmt::format("{} of {} frames gave a pose that the filter accepted\n", s.measured, s.frames);
    if (s.measured == 0) return out;
    out += fmt::format(
        "    single frame: RMS {:.4f} deg, {:.3g} m ({:.3g} % of the range); {:.1f} and {:.1f} times the bound\n",
        s.rotation_rms_rad / kDegree, s.position_rms_m, 100 * s.position_rms_of_range, s.rotation_of_bound,
        s.position_of_bound);
    out += fmt::format("    filtered: RMS {:.4f} deg, {:.3g} m\n", s.filtered_rotation_rms_rad / kDegree,
                       s.filtered_position_rms_m);
    out += fmt::format("    NEES {:.2f} (95 % band {:.2f} to {:.2f}), NIS {:.2f}; expected 6\n", s.nees_mean,
                       s.nees_low, s.nees_high, s.nis_mean);
    return out + fmt::format("    {:.0f} ms per frame (median; max {:.0f})\n", s.ms_median, s.ms_most);
}

Status plot_estimates(const std::string& path, const std::string& title, std::span<const TrackedFrame> frames) {
    nlohmann::json rows = nlohmann::json::array();
    for (const TrackedFrame& f : frames) {
        nlohmann::json row{{"frame", f.frame}, {"t_s", static_cast<double>(f.t_ns) * 1e-9}};
        for (const char* key :
             {"rotation_error_rad", "position_error_m", "rotation_sigma_rad", "position_sigma_m",
              "rotation_bound_rad", "position_bound_m", "rotation_filtered_rad", "position_filtered_m"})
            row[key] = nullptr;
        if (f.measured) {
            const Vector6 error = error_between(*f.measured, f.truth);
            row["rotation_error_rad"] = rotation(error), row["position_error_m"] = position(error);
            row["rotation_sigma_rad"] = rotation_sigma(f.covariance);
            row["position_sigma_m"] = position_sigma(f.covariance);
            row["rotation_bound_rad"] = rotation_sigma(f.bound), row["position_bound_m"] = position_sigma(f.bound);
        }
        if (f.state != EstimateState::lost) {
            const Vector6 error = error_between(f.filtered, f.truth);
            row["rotation_filtered_rad"] = rotation(error), row["position_filtered_m"] = position(error);
        }
        rows.push_back(std::move(row));
    }
    return write_plot(path, {{"plot", "estimates"}, {"title", title}, {"frames", rows}});
}

}  // namespace narpa
