#include "tracking/batch_report.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "plot/plot.h"

namespace narpa {
namespace {

const BatchUnknownRow& row_of(BatchUnknown u) {
    return batch_unknowns()[static_cast<std::size_t>(u)];
}

/// Error of a state's pose against the run's at that time.
Vector6 pose_error(const BatchState& state, const BatchTruth& truth) {
    const auto time = std::ranges::lower_bound(truth.times, state.t_ns, {}, &BatchTime::t_ns);
    return error_between(state.T_chaser_target, *time->T_chaser_target);
}

double error_of(const BatchEstimate& e, const BatchTruth& truth) {
    return e.value - at(truth.unknowns, e.unknown);
}

/// "0.71 camera_mount_deg.x - 0.70 lidar_mount_deg.x", of parts above a fifth.
std::string to_text(const BatchDirection& direction, const std::vector<BatchEstimate>& unknowns) {
    constexpr double kShown = 0.2;
    std::string text;
    for (std::size_t i = 0; i < unknowns.size(); ++i) {
        const double part = direction.parts[i];
        if (std::abs(part) < kShown) continue;
        text += fmt::format("{}{:.2f} {}", part < 0 ? (text.empty() ? "-" : " - ") : (text.empty() ? "" : " + "),
                            std::abs(part), row_of(unknowns[i].unknown).name);
    }
    return text;
}

/// True if a single unknown makes up the combination: the table of unknowns has it already.
bool is_single(const BatchDirection& d) {
    return std::ranges::any_of(d.parts, [](double part) { return part * part > 0.9; });
}

std::string table_of(const BatchResult& r, const BatchTruth& truth) {
    std::string out = fmt::format("    {:<20} {:>11} {:>11} {:>11} {:>11} {:>8}\n", "unknown", "change", "sigma",
                                  "prior", "truth", "error/s.");
    for (const BatchEstimate& e : r.unknowns) {
        const BatchUnknownRow& row = row_of(e.unknown);
        out += fmt::format("    {:<20} {:>11.4g} {:>11.3g} {:>11.3g} {:>11.4g} {:>8.2f}{}\n", row.name,
                           e.value / row.unit, e.sigma / row.unit, e.prior_sigma / row.unit,
                           at(truth.unknowns, e.unknown) / row.unit, std::abs(error_of(e, truth)) / e.sigma,
                           e.is_determined ? "" : "  not determined");
    }
    return out;
}

nlohmann::json matrix_json(const Eigen::MatrixXd& m, const std::vector<BatchEstimate>& unknowns) {
    nlohmann::json rows = nlohmann::json::array();
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
        nlohmann::json row = nlohmann::json::array();
        for (Eigen::Index j = 0; j < m.cols(); ++j)
            row.push_back(m(i, j) / row_of(unknowns[static_cast<std::size_t>(i)].unknown).unit /
                          row_of(unknowns[static_cast<std::size_t>(j)].unknown).unit);
        rows.push_back(row);
    }
    return rows;
}

}  // namespace

BatchErrors errors_of(const BatchResult& r, const BatchTruth& truth) {
    BatchErrors e;
    const auto n = static_cast<double>(r.states.size());
    for (const BatchState& s : r.states) {
        const Vector6 error = pose_error(s, truth);
        e.rotation_rms_rad += error.head<3>().squaredNorm() / n;
        e.position_rms_m += error.tail<3>().squaredNorm() / n;
        e.nees_mean += normalised_error_squared(error, s.pose_covariance) / n;
    }
    e.rotation_rms_rad = std::sqrt(e.rotation_rms_rad), e.position_rms_m = std::sqrt(e.position_rms_m);
    if (r.unknowns.empty()) return e;
    Eigen::VectorXd errors(static_cast<Eigen::Index>(r.unknowns.size())), weights = errors;
    for (Eigen::Index i = 0; i < errors.size(); ++i) {
        const BatchEstimate& u = r.unknowns[static_cast<std::size_t>(i)];
        errors[i] = error_of(u, truth) / u.sigma, weights[i] = 1 / u.sigma;
        if (u.is_determined) e.largest_of_sigma = std::max(e.largest_of_sigma, std::abs(errors[i]));
    }
    const Eigen::MatrixXd correlation = weights.asDiagonal() * r.covariance * weights.asDiagonal();
    e.unknowns_nees = errors.dot(correlation.ldlt().solve(errors));
    return e;
}

std::string undetermined_text(const BatchResult& r) {
    std::string out;
    for (const BatchDirection& d : r.undetermined)
        if (!is_single(d))
            out += fmt::format("    not determined together, sigma {:.2f} of the prior: {}\n", d.sigma,
                               to_text(d, r.unknowns));
    return out;
}

nlohmann::json undetermined_json(const BatchResult& r) {
    nlohmann::json out = nlohmann::json::array();
    for (const BatchDirection& d : r.undetermined) {
        nlohmann::json parts = nlohmann::json::object();
        for (std::size_t i = 0; i < d.parts.size(); ++i)
            parts[std::string(row_of(r.unknowns[i].unknown).name)] = d.parts[i];
        out.push_back({{"parts", parts}, {"sigma", d.sigma}});
    }
    return out;
}

std::string to_text(const BatchResult& r, const BatchTruth& truth) {
    const auto frames = std::ranges::count_if(
        r.residuals, [](const auto& f) { return f.measure == BatchMeasure::points && f.points > 0; });
    const auto sweeps = std::ranges::count_if(
        r.residuals, [](const auto& f) { return f.measure == BatchMeasure::sweep && f.points > 0; });
    const BatchErrors e = errors_of(r, truth);
    std::string out = fmt::format(
        "{} frames and {} sweeps in one least-squares problem: {} unknowns, {} residuals, {} linearisations{}\n",
        frames, sweeps, r.parameters, r.numbers, r.linearisations, r.settled ? "" : ", not settled");
    if (!r.unknowns.empty()) out += table_of(r, truth);
    out += undetermined_text(r);
    if (!r.unknowns.empty())
        out += fmt::format("    NEES of the unknowns {:.2f}, {} expected\n", e.unknowns_nees, r.unknowns.size());
    out += fmt::format("    trajectory: RMS {:.4f} deg, {:.3g} m; NEES {:.2f}, 6 expected\n",
                       e.rotation_rms_rad / kDegree, e.position_rms_m, e.nees_mean);
    for (const EstimateSummary& s : truth.alone)
        out += fmt::format(
            "    {}, one after another: {} of {} accepted, filtered RMS {:.4f} deg, {:.3g} m; NEES {:.2f}\n",
            &s == truth.alone.data() && frames > 0 ? "frames" : "sweeps", s.measured, s.frames,
            s.filtered_rotation_rms_rad / kDegree, s.filtered_position_rms_m, s.nees_mean);
    return out;
}

nlohmann::json to_json(const BatchResult& r, const BatchTruth& truth) {
    nlohmann::json unknowns = nlohmann::json::array(), directions = nlohmann::json::array(),
                   alone = nlohmann::json::array();
    for (const BatchEstimate& u : r.unknowns) {
        const BatchUnknownRow& row = row_of(u.unknown);
        unknowns.push_back({{"name", row.name},
                            {"change", u.value / row.unit},
                            {"sigma", u.sigma / row.unit},
                            {"prior_sigma", u.prior_sigma / row.unit},
                            {"truth", at(truth.unknowns, u.unknown) / row.unit},
                            {"error_of_sigma", std::abs(error_of(u, truth)) / u.sigma},
                            {"determined", u.is_determined}});
    }
    for (const BatchDirection& d : r.undetermined) directions.push_back({{"parts", d.parts}, {"sigma", d.sigma}});
    for (const EstimateSummary& s : truth.alone) alone.push_back(to_json(s));
    const BatchErrors e = errors_of(r, truth);
    return {{"unknowns", unknowns},
            {"covariance", matrix_json(r.covariance, r.unknowns)},
            {"not_determined", directions},
            {"unknowns_nees", e.unknowns_nees},
            {"rotation_rms_rad", e.rotation_rms_rad},
            {"position_rms_m", e.position_rms_m},
            {"nees_mean", e.nees_mean},
            {"one_after_another", alone},
            {"settled", r.settled},
            {"linearisations", r.linearisations},
            {"iterations", r.iterations},
            {"cost_start", r.cost_start},
            {"cost", r.cost},
            {"parameters", r.parameters},
            {"residuals", r.numbers},
            {"jacobian_nonzeros", r.jacobian_nonzeros},
            {"linear_solver", r.solver}};
}

std::string batch_rows(const BatchResult& r, const BatchTruth& truth) {
    std::string out =
        "t_ns,sensor,points,residual_rms_start,residual_rms,outliers,score,score_expected,x_m,y_m,z_m,qw,qx,qy,qz,"
        "sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,sigma_x_m,sigma_y_m,sigma_z_m,error_rotation_rad,error_position_m,"
        "nees\n";
    for (const BatchResidual& f : r.residuals) {
        if (f.points == 0) continue;
        auto state = std::ranges::upper_bound(r.states, f.t_ns, {}, &BatchState::t_ns);
        if (state != r.states.begin()) --state;
        const Rigid3& T = state->T_chaser_target;
        out += fmt::format("{},{},{},{:.6g},{:.6g},{:.4g},{:.6g},{}", f.t_ns,
                           kBatchMeasureNames[static_cast<std::size_t>(f.measure)], f.points, f.rms_start, f.rms,
                           f.downweighted, f.score, f.score_numbers);
        for (const double v : {T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z}) out += fmt::format(",{}", v);
        for (int i = 0; i < 6; ++i) out += fmt::format(",{:.6g}", std::sqrt(state->pose_covariance(i, i)));
        const Vector6 error = pose_error(*state, truth);
        out += fmt::format(",{:.6g},{:.6g},{:.6g}\n", error.head<3>().norm(), error.tail<3>().norm(),
                           normalised_error_squared(error, state->pose_covariance));
    }
    return out;
}

Status plot_batch(const std::string& path, const std::string& title, const BatchResult& r,
                  const BatchTruth& truth) {
    nlohmann::json unknowns = to_json(r, truth)["unknowns"], states = nlohmann::json::array(),
                   residuals = nlohmann::json::array();
    for (const BatchState& s : r.states) {
        const Vector6 error = pose_error(s, truth);
        states.push_back({{"t_s", 1e-9 * static_cast<double>(s.t_ns)},
                          {"rotation_error_rad", error.head<3>().norm()},
                          {"position_error_m", error.tail<3>().norm()},
                          {"rotation_sigma_rad", rotation_sigma(s.pose_covariance)},
                          {"position_sigma_m", position_sigma(s.pose_covariance)}});
    }
    for (const BatchResidual& f : r.residuals)
        if (f.points > 0)
            residuals.push_back({{"t_s", 1e-9 * static_cast<double>(f.t_ns)},
                                 {"measure", kBatchMeasureNames[static_cast<std::size_t>(f.measure)]},
                                 {"start", f.rms_start},
                                 {"end", f.rms}});
    return write_plot(path, {{"plot", "batch"},
                             {"title", title},
                             {"unknowns", unknowns},
                             {"states", states},
                             {"residuals", residuals}});
}

}  // namespace narpa
