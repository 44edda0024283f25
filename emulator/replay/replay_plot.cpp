// The plot of emulator/replay/replay_report.h: a frame, its reference, their difference.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "emulator/replay/replay_report.h"
#include "plot/plot.h"

namespace narpa {
namespace {

constexpr int kMostWidth = 640;  // px; wider images are halved until they fit
constexpr double kShown = 0.98;  // part of the differences within the range of the colours

std::uint8_t srgb_byte(double linear) {
    const double l = std::clamp(linear, 0.0, 1.0),
                 s = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    return static_cast<std::uint8_t>(std::lround(255 * s));
}

nlohmann::json image_of(cv::Mat pixels) {
    cv::Mat shown = pixels;
    int parts = 1;
    while (pixels.cols / parts > kMostWidth) parts *= 2;
    if (parts > 1)
        cv::resize(pixels, shown, {pixels.cols / parts, std::max(1, pixels.rows / parts)}, 0, 0, cv::INTER_AREA);
    return plot_image(shown.cols, shown.rows, shown.channels(), {shown.data, shown.total() * shown.elemSize()});
}

/// As a display shows it; full scale is white.
nlohmann::json as_seen(const RadianceImage& image, double full_scale) {
    cv::Mat rgb(image.height, image.width, CV_8UC3);
    std::transform(image.pixels.begin(), image.pixels.end(), rgb.begin<cv::Vec3b>(), [&](const Rgb& p) {
        const auto byte = [&](float band) { return srgb_byte(static_cast<double>(band) / full_scale); };
        return cv::Vec3b(byte(p.x), byte(p.y), byte(p.z));
    });
    return image_of(rgb);
}

/// The differences of the mean bands as parts of full scale, and how large nearly all of them are at most.
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
                         CV_8U);  // 127: as the reference; 0 and 254: the range's ends
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
