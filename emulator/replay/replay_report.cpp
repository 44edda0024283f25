#include "emulator/replay/replay_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "emulator/log/statistics.h"
#include "plot/plot.h"

namespace narpa {
namespace {

using nlohmann::json;

/// A reference error above this fraction of a frame's error affects the frame's numbers.
constexpr double kGoodReference = 1.0 / 3;

/// Largest shift of a body's centroid; empty where none was measured.
std::optional<double> largest_shift_px(const ImageDifference& d) {
    std::optional<double> most;
    for (const BodyShift& b : d.bodies) most = std::max(most.value_or(0), std::hypot(b.x_px, b.y_px));
    return most;
}

double ratio(double a, double b) {
    return b > 0 ? a / b : 0;
}

json shift_document(const ShiftStatistics& s) {
    return {{"pixels", s.count}, {"mean_px", s.mean_px}, {"rms_px", s.rms_px}, {"p99_px", s.p99_px}};
}

std::string or_dash(const char* format, const std::optional<double>& value) {
    return value ? fmt::format(fmt::runtime(format), *value) : "-";
}

}  // namespace

double ReplayedFrame::measured_error() const noexcept {
    const double error = compared->difference.rmse, noise = compared->reference_error;
    return std::sqrt(std::max(0.0, error * error - noise * noise)) / compared->difference.full_scale;
}

std::optional<double> ReplayedFrame::predicted_over_measured() const noexcept {
    const double measured = measured_error();
    if (logged.ledger.expected_error < 0 || measured == 0) return std::nullopt;
    return static_cast<double>(logged.ledger.expected_error) / measured;
}

BudgetCost budget_cost(std::span<const ReplayedFrame> frames) {
    BudgetCost c;
    double squares = 0, noise = 0, predicted = 0, measured = 0, edges = 0, edge_squares = 0, body_squares = 0;
    double ssim = 0;
    for (const ReplayedFrame& f : frames) {
        if (!f.compared) continue;
        const ImageDifference& d = f.compared->difference;
        const double rmse = d.rmse / d.full_scale, reference = f.compared->reference_error / d.full_scale;
        ++c.frames;
        squares += rmse * rmse;
        noise += reference * reference;
        c.rmse_largest = std::max(c.rmse_largest, rmse);
        c.bias += d.bias / d.full_scale;
        ssim += d.ssim;
        c.ssim_min = std::min(c.ssim_min, d.ssim);
        const auto pixels = static_cast<double>(d.edges.count);
        c.edges.count += d.edges.count;
        edges += pixels * d.edges.mean_px;
        edge_squares += pixels * d.edges.rms_px * d.edges.rms_px;
        c.edges.p99_px = std::max(c.edges.p99_px, d.edges.p99_px);
        for (const BodyShift& b : d.bodies) {
            ++c.bodies;
            c.bodies_x_px += b.x_px;
            c.bodies_y_px += b.y_px;
            body_squares += b.x_px * b.x_px + b.y_px * b.y_px;
        }
        c.bodies_largest_px = std::max(c.bodies_largest_px, largest_shift_px(d).value_or(0));
        if (f.predicted_over_measured()) {
            const auto expected = static_cast<double>(f.logged.ledger.expected_error);
            predicted += expected * expected;
            measured += f.measured_error() * f.measured_error();
        }
    }
    const auto n = static_cast<double>(c.frames);
    c.rmse = std::sqrt(ratio(squares, n));
    c.reference_error = std::sqrt(ratio(noise, n));
    c.bias = ratio(c.bias, n);
    if (c.frames > 0) c.ssim_mean = ssim / n;
    c.edges.mean_px = ratio(edges, static_cast<double>(c.edges.count));
    c.edges.rms_px = std::sqrt(ratio(edge_squares, static_cast<double>(c.edges.count)));
    c.bodies_x_px = ratio(c.bodies_x_px, static_cast<double>(c.bodies));
    c.bodies_y_px = ratio(c.bodies_y_px, static_cast<double>(c.bodies));
    c.bodies_rms_px = std::sqrt(ratio(body_squares, static_cast<double>(c.bodies)));
    if (measured > 0) c.predicted_over_measured = std::sqrt(predicted / measured);
    return c;
}

json to_json(const ReplayedFrame& f, const Scene& scene) {
    const FrameLedger& l = f.logged.ledger;
    json out{{"frame", l.frame},
             {"t_s", static_cast<double>(l.t_exposure_mid_ns) * 1e-9},
             {"step", kStepNames[l.step]},
             {"samples_per_pixel", l.samples_per_pixel},
             {"differs", f.differs}};
    if (!f.compared) return out;
    const ImageDifference& d = f.compared->difference;
    json bodies = json::array();
    for (const BodyShift& b : d.bodies)
        bodies.push_back(
            {{"body", scene.bodies[static_cast<std::size_t>(b.body)].name}, {"x_px", b.x_px}, {"y_px", b.y_px}});
    const auto predicted = f.predicted_over_measured();
    out.update({{"rmse", d.rmse / d.full_scale},
                {"bias", d.bias / d.full_scale},
                {"reference_error", f.compared->reference_error / d.full_scale},
                {"expected_error", l.expected_error < 0 ? json(nullptr) : json(l.expected_error)},
                {"predicted_over_measured", predicted ? json(*predicted) : json(nullptr)},
                {"ssim", d.ssim},
                {"edges", shift_document(d.edges)},
                {"bodies", bodies}});
    return out;
}

json to_json(const BudgetCost& c) {
    return {
        {"frames", c.frames},
        {"rmse", c.rmse},
        {"rmse_largest", c.rmse_largest},
        {"bias", c.bias},
        {"reference_error", c.reference_error},
        {"predicted_over_measured", c.predicted_over_measured ? json(*c.predicted_over_measured) : json(nullptr)},
        {"ssim_mean", c.ssim_mean},
        {"ssim_least", c.ssim_min},
        {"edges", shift_document(c.edges)},
        {"bodies",
         {{"centroids", c.bodies},
          {"mean_x_px", c.bodies_x_px},
          {"mean_y_px", c.bodies_y_px},
          {"rms_px", c.bodies_rms_px},
          {"largest_px", c.bodies_largest_px}}}};
}

std::string to_text(std::span<const ReplayedFrame> frames, const BudgetCost& cost) {
    const auto row = [](const std::string& frame, const std::string& t, std::string_view step,
                        const std::string& spp, double rmse, double bias, const std::optional<double>& predicted,
                        double ssim, const ShiftStatistics& edges, const std::optional<double>& bodies_px) {
        return fmt::format("{:>7} {:>9} {:>12} {:>7} {:>9.4f} {:>9.4f} {:>10} {:>8.5f} {:>9.4f} / {:.4f} {:>9}\n",
                           frame, t, step, spp, 100 * rmse, 100 * bias, or_dash("{:.2f}", predicted), ssim,
                           edges.mean_px, edges.rms_px, or_dash("{:.4f}", bodies_px));
    };
    constexpr const char* kHead = "{:>7} {:>9} {:>12} {:>7} {:>9} {:>9} {:>10} {:>8} {:>18} {:>9}\n";
    std::string out =
        fmt::format("spp: samples per pixel, {}\n", kSamplesPerPixelNote) +
        fmt::format(kHead, "frame", "t [s]", "step", "spp", "RMSE [%]", "bias [%]", "predicted", "SSIM",
                    "edges [px]", "bodies") +
        fmt::format(kHead, "", "", "", "", "of scale", "of scale", "/ measured", "", "mean / rms", "[px]");
    for (const ReplayedFrame& f : frames) {
        const ImageDifference& d = f.compared->difference;
        const FrameLedger& l = f.logged.ledger;
        out +=
            row(fmt::format("{}", l.frame), fmt::format("{:.3f}", static_cast<double>(l.t_exposure_mid_ns) * 1e-9),
                kStepNames[l.step], fmt::format("{:.2f}", l.samples_per_pixel), d.rmse / d.full_scale,
                d.bias / d.full_scale, f.predicted_over_measured(), d.ssim, d.edges, largest_shift_px(d));
    }
    out += row("all", "", "", "", cost.rmse, cost.bias, cost.predicted_over_measured, cost.ssim_mean, cost.edges,
               cost.bodies > 0 ? std::optional(cost.bodies_rms_px) : std::nullopt);
    out += fmt::format(
        "worst: RMSE {:.4f} %, SSIM {:.5f}, 1 % of the edges beyond {:.3f} px{}; the reference's own "
        "error {:.4f} %\n",
        100 * cost.rmse_largest, cost.ssim_min, cost.edges.p99_px,
        cost.bodies > 0 ? fmt::format(", a body {:.4f} px", cost.bodies_largest_px) : "",
        100 * cost.reference_error);
    if (cost.reference_error > kGoodReference * cost.rmse)
        out += "the reference is hardly better than the frames, expected a higher --reference\n";
    return out;
}

// --- Plot -------------------------------------------------------------------------------------------------------

namespace {

constexpr int kMaxWidth = 640;   // px; wider images are halved until they fit
constexpr double kShown = 0.98;  // part of the differences within the range of the colours

nlohmann::json image_of(cv::Mat pixels) {
    cv::Mat shown = pixels;
    int parts = 1;
    while (pixels.cols / parts > kMaxWidth) parts *= 2;
    if (parts > 1)
        cv::resize(pixels, shown, {pixels.cols / parts, std::max(1, pixels.rows / parts)}, 0, 0, cv::INTER_AREA);
    return plot_image(shown.cols, shown.rows, shown.channels(), {shown.data, shown.total() * shown.elemSize()});
}

/// The image as sRGB; full scale is white.
nlohmann::json as_seen(const RadianceImage& image, double full_scale) {
    cv::Mat rgb(image.height, image.width, CV_8UC3);
    std::transform(image.pixels.begin(), image.pixels.end(), rgb.begin<cv::Vec3b>(), [&](const Rgb& p) {
        const auto byte = [&](float band) { return srgb_byte(static_cast<double>(band) / full_scale); };
        return cv::Vec3b(byte(p.x), byte(p.y), byte(p.z));
    });
    return image_of(rgb);
}

/// Differences of the mean bands as fractions of full scale, and the magnitude that kShown of them do not exceed.
struct Differences {
    std::vector<double> of;
    double range = 0;
};
Differences differences(const RadianceImage& a, const RadianceImage& b, double full_scale) {
    Differences d;
    std::vector<double> sizes;
    for (std::size_t i = 0; i < a.pixels.size(); ++i) {
        d.of.push_back((mean_band(vec_cast<double>(a.pixels[i])) - mean_band(vec_cast<double>(b.pixels[i]))) /
                       full_scale);
        sizes.push_back(std::abs(d.of.back()));
    }
    const auto last = sizes.begin() + static_cast<std::ptrdiff_t>(kShown * static_cast<double>(sizes.size() - 1));
    std::nth_element(sizes.begin(), last, sizes.end());
    d.range = *last > 0 ? *last : std::max(1e-6, *std::max_element(sizes.begin(), sizes.end()));
    return d;
}

}  // namespace

Status plot_replay(const std::string& path, const std::string& title, const ReplayedFrame& frame,
                   const RadianceImage& picture, const RadianceImage& reference) {
    const ImageDifference& d = frame.compared->difference;
    const Differences off = differences(picture, reference, d.full_scale);
    cv::Mat signed_bytes(picture.height, picture.width,
                         CV_8U);  // 127: no difference; 0 and 254: ends of the range
    std::transform(off.of.begin(), off.of.end(), signed_bytes.begin<std::uint8_t>(), [&](double part) {
        return static_cast<std::uint8_t>(std::lround(127 + 127 * std::clamp(part / off.range, -1.0, 1.0)));
    });
    const FrameLedger& l = frame.logged.ledger;
    return write_plot(
        path, {{"plot", "replay"},
               {"title", title},
               {"caption", fmt::format("frame {}: {}, {:.2f} spp, RMSE {:.3f} %", l.frame, kStepNames[l.step],
                                       l.samples_per_pixel, 100 * d.rmse / d.full_scale)},
               {"difference_range_percent", 100 * off.range},
               {"frame", as_seen(picture, d.full_scale)},
               {"reference", as_seen(reference, d.full_scale)},
               {"difference", image_of(signed_bytes)}});
}

}  // namespace narpa
