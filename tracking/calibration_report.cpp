#include "tracking/calibration_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "plot/plot.h"
#include "tracking/batch_report.h"
#include "tracking/estimate_report.h"

namespace narpa {
namespace {

std::size_t points_of(const CameraCalibration& c) {
    std::size_t n = 0;
    for (const CalibrationView& v : c.views) n += v.seen.size();
    return n;
}

std::string name_of(const CalibrationView& v) {
    return std::filesystem::path(v.file).filename().string();
}

std::string class_of(const CalibrationView& v) {
    return std::string(kAnswerKinds[static_cast<std::size_t>(v.answer.kind)]);
}

/// Commas and quotes as a CSV file has them.
std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
}

}  // namespace

std::string to_text(const CameraCalibration& c) {
    std::string out = fmt::format("{} of {} images, {} points, RMS reprojection error {:.3f} px; {} rounds{}\n",
                                  std::ranges::count_if(c.views, &CalibrationView::is_used), c.views.size(),
                                  points_of(c), c.rms_px, c.rounds, c.has_settled ? "" : ", not settled");
    out += fmt::format("    {:<10} {:>12} {:>12} {:>11}\n", "parameter", "start", "value", "sigma");
    for (const CameraParameter& p : c.parameters)
        out += fmt::format("    {:<10} {:>12.7g} {:>12.7g} {:>11.3g}{}\n", p.name, p.start, p.value, p.sigma,
                           p.is_determined ? "" : "  not determined");
    out += undetermined_text(c.batch);
    out += fmt::format("    {:<24} {:>7} {:>8} {:>9} {:>9} {:>10} {:>8}  {}\n", "image", "points", "RMS px",
                       "outliers", "range m", "sigma mm", "deg", "answer");
    for (const CalibrationView& v : c.views) {
        out += fmt::format("    {:<24}", name_of(v));
        if (v.is_used)
            out += fmt::format(" {:>7} {:>8.3f} {:>7.1f} % {:>9.4g} {:>10.3g} {:>8.3g}  ", v.seen.size(),
                               v.residual.rms, 100 * v.residual.downweighted, norm(v.T_camera_target.t),
                               1e3 * position_sigma(v.covariance), rotation_sigma(v.covariance) / kDegree);
        else
            out += " not used: ";
        out += class_of(v) + (v.answer.why.empty() ? "" : ", " + v.answer.why) + "\n";
    }
    return out;
}

nlohmann::json to_json(const CameraCalibration& c) {
    nlohmann::json parameters = nlohmann::json::array(), rows = nlohmann::json::array(),
                   views = nlohmann::json::array();
    for (const CameraParameter& p : c.parameters)
        parameters.push_back({{"name", p.name},
                              {"start", p.start},
                              {"value", p.value},
                              {"sigma", p.sigma},
                              {"determined", p.is_determined}});
    for (Eigen::Index i = 0; i < c.covariance.rows(); ++i) {
        nlohmann::json row = nlohmann::json::array();
        for (Eigen::Index j = 0; j < c.covariance.cols(); ++j) row.push_back(c.covariance(i, j));
        rows.push_back(row);
    }
    for (const CalibrationView& v : c.views) {
        nlohmann::json view{{"image", v.file}, {"used", v.is_used}, {"answer", to_json(v.answer)}};
        if (v.is_used) {
            nlohmann::json covariance = nlohmann::json::array();
            for (int i = 0; i < 6; ++i) {
                nlohmann::json row = nlohmann::json::array();
                for (int j = 0; j < 6; ++j) row.push_back(v.covariance(i, j));
                covariance.push_back(row);
            }
            view.update({{"pose", to_json(v.T_camera_target)},
                         {"covariance", covariance},
                         {"points", v.seen.size()},
                         {"rms_px", v.residual.rms},
                         {"outliers", v.residual.downweighted}});
        }
        views.push_back(view);
    }
    return {{"passed", c.has_settled}, {"parameters", parameters},
            {"covariance", rows},      {"undetermined", undetermined_json(c.batch)},
            {"rms_px", c.rms_px},      {"points", points_of(c)},
            {"rounds", c.rounds},      {"settled", c.has_settled},
            {"images", views}};
}

std::string calibration_rows(const CameraCalibration& c) {
    std::string out =
        "image,used,answer,points,rms_px,outliers,x_m,y_m,z_m,qw,qx,qy,qz,sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,"
        "sigma_x_m,sigma_y_m,sigma_z_m,why\n";
    for (const CalibrationView& v : c.views) {
        out += fmt::format("{},{},{}", quoted(v.file), v.is_used ? 1 : 0, class_of(v));
        if (v.is_used) {
            const Rigid3& T = v.T_camera_target;
            out += fmt::format(",{},{:.6g},{:.4g}", v.seen.size(), v.residual.rms, v.residual.downweighted);
            for (const double x : {T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z}) out += fmt::format(",{}", x);
            for (int i = 0; i < 6; ++i) out += fmt::format(",{:.6g}", std::sqrt(v.covariance(i, i)));
        } else {
            out += std::string(16, ',');
        }
        out += "," + quoted(v.answer.why) + "\n";
    }
    return out;
}

Status plot_calibration(const std::string& path, const std::string& title, int width, int height,
                        const CameraCalibration& c) {
    nlohmann::json points = nlohmann::json::array(), views = nlohmann::json::array();
    for (const CalibrationView& v : c.views) {
        if (!v.is_used) continue;
        views.push_back({{"image", name_of(v)}, {"rms_px", v.residual.rms}});
        for (std::size_t k = 0; k < v.seen.size(); ++k)
            points.push_back({v.seen[k].u, v.seen[k].v, v.error[k].u, v.error[k].v});
    }
    return write_plot(path, {{"plot", "calibration"},
                             {"title", title},
                             {"width", width},
                             {"height", height},
                             {"rms_px", c.rms_px},
                             {"points", points},
                             {"images", views}});
}

}  // namespace narpa
