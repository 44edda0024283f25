#include "tracking/estimate_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "estimator/uncertainty/observed_error.h"
#include "plot/plot.h"

namespace narpa {
namespace {

/// Errors of one frame against the truth; zeros where there is no pose.
struct Errors {
    explicit Errors(const TrackedFrame& f) {
        if (f.measured) {
            vector = error_between(*f.measured, f.truth);
            nees = observed_error(*f.measured, f.covariance, f.answer, f.truth);
        }
        if (f.state != EstimateState::lost) filtered = error_between(f.filtered, f.truth);
    }
    Vector6 vector = Vector6::Zero(), filtered = Vector6::Zero();
    ObservedError nees;
    [[nodiscard]] double rotation() const { return vector.head<3>().norm(); }
    [[nodiscard]] double position() const { return vector.tail<3>().norm(); }
    [[nodiscard]] double filtered_rotation() const { return filtered.head<3>().norm(); }
    [[nodiscard]] double filtered_position() const { return filtered.tail<3>().norm(); }
};
/// RMS of the added values.
struct Squares {
    double sum = 0;
    std::size_t n = 0;
    void add(double v) { sum += v * v, ++n; }
    [[nodiscard]] double rms() const { return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0; }
};

/// Mean of chi-square values, and its 95 % interval.
struct ChiSquares {
    double sum = 0, freedom = 0;
    std::size_t n = 0;
    void add(double value, int of_freedom) { sum += value, freedom += of_freedom, ++n; }
    [[nodiscard]] double mean() const { return n > 0 ? sum / static_cast<double>(n) : 0; }
    [[nodiscard]] double expected() const { return n > 0 ? freedom / static_cast<double>(n) : 0; }
    [[nodiscard]] double half_interval() const { return 1.96 * std::sqrt(2 * freedom) / static_cast<double>(n); }
};

}  // namespace

std::string estimate_row(const TrackedFrame& f) {
    std::string row = fmt::format("{},{},{},", f.frame, f.t_ns, kEstimateStates[static_cast<std::size_t>(f.state)]);
    const auto add = [&](bool known, auto... values) {
        ((row += known ? fmt::format("{:.6g},", values) : ","), ...);
    };
    const bool known = f.measured.has_value(), tracked = f.state != EstimateState::lost;
    const Rigid3 T = f.measured.value_or(Rigid3{});
    const Errors e(f);
    for (const double value : {T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z})
        row += known ? fmt::format("{},", value) : ",";
    for (int i = 0; i < 6; ++i) add(known, std::sqrt(f.covariance(i, i)));
    add(known, e.rotation(), e.position());
    add(tracked, e.filtered_rotation(), e.filtered_position());
    add(known, e.nees.squared, f.nis, rotation_sigma(f.bound), position_sigma(f.bound));
    std::string why = f.why;  // one field
    std::replace(why.begin(), why.end(), ',', ';');
    return row + fmt::format("{},{},{:.3f},{},{}\n", f.matches, f.renders, f.ms,
                             kAnswerKinds[static_cast<std::size_t>(f.answer.kind)], why);
}

nlohmann::json to_json(const Rigid3& T) {
    return {{"position_m", {T.t.x, T.t.y, T.t.z}}, {"attitude_wxyz", {T.q.w, T.q.x, T.q.y, T.q.z}}};
}

nlohmann::json to_json(const Answer& answer) {
    nlohmann::json motions = nlohmann::json::array(), rivals = nlohmann::json::array();
    for (int i = 0; i < answer.observability.unobserved; ++i) {
        const Vector6 m = answer.observability.motions.col(i);
        motions.push_back({{"rotation_rad", {m[0], m[1], m[2]}}, {"translation_m", {m[3], m[4], m[5]}}});
    }
    for (const Rival& r : answer.rivals) {
        rivals.push_back(to_json(r.T_sensor_target));
        rivals.back()["worse_chi2"] = r.worse_chi2;
    }
    return {{"class", kAnswerKinds[static_cast<std::size_t>(answer.kind)]},
            {"why", answer.why},
            {"unobserved_motions", motions},
            {"alternatives", rivals}};
}

NeesBand nees_band(int observed) {
    // Quantiles 0.025 and 0.975 of chi-square.
    constexpr std::array<NeesBand, 6> kBands{
        {{0.00098, 5.024}, {0.0506, 7.378}, {0.216, 9.348}, {0.484, 11.143}, {0.831, 12.833}, {1.237, 14.449}}};
    return kBands[static_cast<std::size_t>(std::clamp(observed, 1, 6)) - 1];
}

std::string nees_verdict(double nees, double low, double high) {
    if (!std::isfinite(nees)) return "not known: the covariance is singular";
    if (nees < low) return "below: the covariances are too cautious, the errors are smaller than they say";
    if (nees > high) return "above: the covariances are too small, the errors are larger than they say";
    return "inside: the errors are as the covariances say";
}

EstimateSummary summarise(std::span<const TrackedFrame> frames) {
    EstimateSummary s;
    s.frames = frames.size();
    Squares rotation, position, position_of_range, filtered_rotation, filtered_position, rotation_of_bound,
        position_of_bound;
    ChiSquares nees, nis;
    std::vector<double> ms;
    for (const TrackedFrame& f : frames) {
        ms.push_back(f.ms);
        const Errors e(f);
        ++s.answers[static_cast<std::size_t>(f.answer.kind)];
        if (f.answer.kind == AnswerKind::good && f.measured) s.beyond += !(e.nees.squared <= kSixSigmaNees);
        if (f.state != EstimateState::lost)
            filtered_rotation.add(e.filtered_rotation()), filtered_position.add(e.filtered_position());
        if (f.state != EstimateState::measured || !f.measured) continue;
        if (f.nis > 0) nis.add(f.nis, e.nees.freedom);
        ++s.measured;
        rotation.add(e.rotation()), position.add(e.position()),
            position_of_range.add(e.position() / norm(f.truth.t));
        if (std::isfinite(e.nees.squared)) nees.add(e.nees.squared, e.nees.freedom);
        if (f.bound.topLeftCorner<3, 3>().trace() > 0) {
            rotation_of_bound.add(e.rotation() / rotation_sigma(f.bound));
            position_of_bound.add(e.position() / position_sigma(f.bound));
        }
    }
    s.rotation_rms_rad = rotation.rms(), s.position_rms_m = position.rms(),
    s.position_rms_of_range = position_of_range.rms();
    s.filtered_rotation_rms_rad = filtered_rotation.rms(), s.filtered_position_rms_m = filtered_position.rms();
    s.rotation_of_bound = rotation_of_bound.rms(), s.position_of_bound = position_of_bound.rms();
    s.nees_mean = nees.mean(), s.nees_expected = nees.expected();
    if (nees.n > 0) {
        s.nees_low = std::max(0.0, s.nees_expected - nees.half_interval());
        s.nees_high = s.nees_expected + nees.half_interval();
    }
    s.nis_mean = nis.mean(), s.nis_expected = nis.expected();
    if (!ms.empty()) {
        const auto middle = ms.begin() + static_cast<std::ptrdiff_t>(ms.size() / 2);
        std::nth_element(ms.begin(), middle, ms.end());
        s.ms_median = *middle;
        s.ms_max = *std::max_element(ms.begin(), ms.end());
    }
    return s;
}

nlohmann::json to_json(const EstimateSummary& s) {
    nlohmann::json answers;
    for (std::size_t i = 0; i < kAnswerKinds.size(); ++i) answers[std::string(kAnswerKinds[i])] = s.answers[i];
    return {{"frames", s.frames},
            {"measured", s.measured},
            {"answers", answers},
            {"good_beyond_six_sigma", s.beyond},
            {"rotation_rms_rad", s.rotation_rms_rad},
            {"position_rms_m", s.position_rms_m},
            {"position_rms_of_range", s.position_rms_of_range},
            {"filtered_rotation_rms_rad", s.filtered_rotation_rms_rad},
            {"filtered_position_rms_m", s.filtered_position_rms_m},
            {"nees_mean", s.nees_mean},
            {"nees_expected", s.nees_expected},
            {"nees_95", {s.nees_low, s.nees_high}},
            {"nees_verdict", s.nees_high > 0 ? nlohmann::json(nees_verdict(s.nees_mean, s.nees_low, s.nees_high))
                                             : nlohmann::json(nullptr)},
            {"nis_mean", s.nis_mean},
            {"nis_expected", s.nis_expected},
            {"rotation_of_bound", s.rotation_of_bound},
            {"position_of_bound", s.position_of_bound},
            {"ms_median", s.ms_median},
            {"ms_most", s.ms_max}};
}

std::string to_text(const EstimateSummary& s, std::string_view item) {
    std::string out =
        fmt::format("{} of {} {}s gave a pose that the filter accepted\n", s.measured, s.frames, item);
    out += fmt::format(
        "    answers: {} good, {} ambiguous, {} unobservable in some motions, {} refused; {} good ones "
        "beyond 6 sigma\n",
        s.answers[0], s.answers[1], s.answers[2], s.answers[3], s.beyond);
    if (s.measured == 0) return out;
    out += fmt::format(
        "    single {}: RMS {:.4f} deg, {:.3g} m ({:.3g} % of the range); {:.1f} and {:.1f} times the bound\n",
        item, s.rotation_rms_rad / kDegree, s.position_rms_m, 100 * s.position_rms_of_range, s.rotation_of_bound,
        s.position_of_bound);
    out += fmt::format("    filtered: RMS {:.4f} deg, {:.3g} m\n", s.filtered_rotation_rms_rad / kDegree,
                       s.filtered_position_rms_m);
    if (s.nees_high > 0)
        out += fmt::format("    NEES {:.2f}, {:.3g} expected, 95 % band {:.2f} to {:.2f}; {}\n", s.nees_mean,
                           s.nees_expected, s.nees_low, s.nees_high,
                           nees_verdict(s.nees_mean, s.nees_low, s.nees_high));
    if (s.nis_mean > 0) out += fmt::format("    NIS {:.2f}, {:.3g} expected\n", s.nis_mean, s.nis_expected);
    return out + fmt::format("    {:.0f} ms per {} (median; max {:.0f})\n", s.ms_median, item, s.ms_max);
}

Status plot_estimates(const std::string& path, const std::string& title, std::span<const TrackedFrame> frames) {
    nlohmann::json rows = nlohmann::json::array();
    for (const TrackedFrame& f : frames) {
        const auto value = [](bool known, double v) { return known ? nlohmann::json(v) : nlohmann::json(nullptr); };
        const bool known = f.measured.has_value(), tracked = f.state != EstimateState::lost;
        const Errors e(f);
        rows.push_back({{"frame", f.frame},
                        {"t_s", static_cast<double>(f.t_ns) * 1e-9},
                        {"rotation_error_rad", value(known, e.rotation())},
                        {"position_error_m", value(known, e.position())},
                        {"rotation_sigma_rad", value(known, rotation_sigma(f.covariance))},
                        {"position_sigma_m", value(known, position_sigma(f.covariance))},
                        {"rotation_bound_rad", value(known, rotation_sigma(f.bound))},
                        {"position_bound_m", value(known, position_sigma(f.bound))},
                        {"rotation_filtered_rad", value(tracked, e.filtered_rotation())},
                        {"position_filtered_m", value(tracked, e.filtered_position())}});
    }
    return write_plot(path, {{"plot", "estimates"}, {"title", title}, {"frames", rows}});
}

}  // namespace narpa
