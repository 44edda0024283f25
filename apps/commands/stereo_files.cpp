#include "apps/commands/stereo_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/cli.h"
#include "apps/commands/cloud_file.h"
#include "base/constants.h"
#include "base/text/base64.h"
#include "base/write_file.h"
#include "estimator/least_squares/median.h"
#include "estimator/stereo/depth_map.h"
#include "plot/plot.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/image/image_file.h"

namespace narpa::cli {
namespace {

/// The matches are searched within a sphere about the target that is larger by this part of it.
constexpr double kMapMargin = 0.1;

std::string extension_of(const std::string& path) {
    return std::filesystem::path(path).extension().string();
}

/// out/depth.png of frame 7: out/depth-000007.png.
std::string numbered(const std::string& path, std::optional<std::uint32_t> number) {
    if (!number) return path;
    const std::filesystem::path p(path);
    return (p.parent_path() / fmt::format("{}-{:06}{}", p.stem().string(), *number, p.extension().string()))
        .string();
}

struct Grid {
    StereoPoints matches;
    std::vector<double> depths_m;
};

/// The picture of python/narpa/plots/surface.py: depths over the left frame.
nlohmann::json picture_of(const Grid& grid, const MatchedPair& of) {
    const MeasuredImage& image = of.images.left;
    const double black = sensor_model(of.images.pair.left).black_dn;
    std::vector<float> sorted = image.dn;
    std::ranges::sort(sorted);
    const double white = std::max(1.0, sorted[sorted.size() * 99 / 100] - black);
    std::vector<std::uint8_t> shade(image.dn.size());
    std::ranges::transform(image.dn, shade.begin(), [&](float dn) {
        return srgb_byte(std::clamp((static_cast<double>(dn) - black) / white, 0.0, 1.0));
    });
    std::vector<double> depths;
    for (const StereoPoint& p : grid.matches.points) depths.push_back(p.point.point_m.z());
    std::ranges::sort(depths);
    const auto quantile = [&](double q) {
        if (depths.empty()) return nlohmann::json(nullptr);
        return nlohmann::json(depths[static_cast<std::size_t>(q * static_cast<double>(depths.size() - 1))]);
    };
    const std::vector<float> values(grid.depths_m.begin(), grid.depths_m.end());
    return {{"plot", "map"},
            {"title", fmt::format("{}: depth by stereo, cameras {}, {}", of.world.scene().name,
                                  of.images.pair.left.name, of.images.pair.right.name)},
            {"of", "depth"},
            {"datum_m", 0},
            {"lowest_m", quantile(0.01)},
            {"highest_m", quantile(0.99)},
            {"width", image.width},
            {"height", image.height},
            {"values_m", base64({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)})},
            {"shade", plot_image(image.width, image.height, 1, shade)},
            {"levels_m", nlohmann::json::array()},
            {"lines", nlohmann::json::array()}};
}

Status write_cloud_file(const std::string& path, const StereoPoints& matches, const MeasuredImage& left) {
    std::ofstream out(path);
    if (!out) return cannot_open_to_write(path);
    const bool csv = extension_of(path) == ".csv";
    std::vector<std::string> lines;
    for (const StereoPoint& p : matches.points) {
        const Eigen::Vector3d& x = p.point.point_m;
        const Eigen::Matrix3d& C = p.point.covariance_m2;
        const int u = static_cast<int>(p.left_px.x()), v = static_cast<int>(p.left_px.y());
        lines.push_back(csv ? fmt::format("{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", u,
                                          v, x.x(), x.y(), x.z(), left.at(u, v), p.range_sigma_m(), C(0, 0),
                                          C(0, 1), C(0, 2), C(1, 1), C(1, 2), C(2, 2))
                            : fmt::format("{:.7g} {:.7g} {:.7g} {} {:.6g}\n", x.x(), x.y(), x.z(), left.at(u, v),
                                          p.range_sigma_m()));
    }
    constexpr std::array<std::string_view, 5> kFields{"x", "y", "z", "intensity", "sigma"};
    if (csv) {
        out << "u_px,v_px,x_m,y_m,z_m,intensity_dn,sigma_m,xx_m2,xy_m2,xz_m2,yy_m2,yz_m2,zz_m2\n";
        for (const std::string& line : lines) out << line;
    } else {
        write_cloud(out, extension_of(path) == ".ply",
                    "left camera's frame, metres; sigma: standard deviation along the ray", kFields, lines);
    }
    out.close();
    if (!out) return Error{"cannot be written to the end", path, 0, 0, ErrorKind::failed};
    return Ok{};
}

/// Errors of the points along their rays against the tracer's ranges.
nlohmann::json errors_of(const StereoPoints& matches, const MatchedPair& of) {
    const Rigid3 T_world_left =
        of.world.camera_pose(of.images.pair.left, 1e-9 * static_cast<double>(of.tracked.t_ns), of.at);
    std::vector<double> errors, sigmas;
    std::size_t within = 0;
    for (const StereoPoint& p : matches.points) {
        const Vec3 ray = normalized(to_vec3(p.point.point_m));
        const Hit hit = of.world.tracer().intersect(of.at, {T_world_left.t, T_world_left.q * ray}, kInfinity);
        const double error = hit.body < 0 ? kInfinity : std::abs(p.point.point_m.norm() - hit.range_m);
        errors.push_back(error);
        sigmas.push_back(p.range_sigma_m());
        within += error < 3 * p.range_sigma_m();
    }
    const double median_m = upper_median(std::span(errors)), sigma_m = upper_median(std::span(sigmas));
    const double share = static_cast<double>(within) / static_cast<double>(std::max<std::size_t>(1, errors.size()));
    say(fmt::format("  {} depths: median error {:.3g} m, median sigma {:.3g} m, {:.1f} % within three sigma",
                    errors.size(), median_m, sigma_m, 100 * share));
    return {{"median_error_m", median_m}, {"median_sigma_m", sigma_m}, {"within_three_sigma", share}};
}

}  // namespace

Status StereoFiles::prepare() const {
    for (const std::string& path : maps) {
        const Status good = extension_of(path) == ".pfm" ? make_folder_of(path) : make_folder_of_picture(path);
        if (!good) return good;
    }
    for (const std::string& path : clouds) {
        const std::string extension = extension_of(path);
        if (extension != ".ply" && extension != ".pcd" && extension != ".csv")
            return Error{"unknown kind of file, expected .ply, .pcd or .csv", path};
        if (auto made = make_folder_of(path); !made) return made;
    }
    return Ok{};
}

Result<nlohmann::json> write_stereo_files(const StereoFiles& files, const MatchedPair& of,
                                          std::optional<std::uint32_t> number) {
    const Rigid3 T = of.tracked.measured.value_or(of.tracked.guess);
    const double reach_m = of.world.tracer().bounding_radius_m(static_cast<std::uint32_t>(of.target));
    StereoSettings settings = stereo_settings_near({T.t, (1 + kMapMargin) * reach_m});
    settings.grid_px = files.grid_px;
    auto matches = match_stereo(of.images.pair, of.images.left, of.images.right, settings);
    if (!matches) return matches.error();
    Grid grid{*std::move(matches), {}};
    grid.depths_m = depth_map(grid.matches, of.images.left.width, of.images.left.height, files.grid_px);
    nlohmann::json document{{"frame", of.tracked.frame}, {"points", grid.matches.points.size()}};
    for (const std::string& path : files.maps) {
        const std::string file = numbered(path, number);
        const Status written = extension_of(file) == ".pfm"
                                   ? write_pfm(file, of.images.left.width, of.images.left.height, grid.depths_m)
                                   : write_plot(file, picture_of(grid, of));
        if (!written) return written.error();
        say("wrote " + file);
        document["files"].push_back(file);
    }
    for (const std::string& path : files.clouds) {
        const std::string file = numbered(path, number);
        if (auto written = write_cloud_file(file, grid.matches, of.images.left); !written) return written.error();
        say("wrote " + file);
        document["files"].push_back(file);
    }
    say("  grid: " + to_text(grid.matches.counts));
    if (of.has_truth && !grid.matches.points.empty()) document.update(errors_of(grid.matches, of));
    return document;
}

}  // namespace narpa::cli
