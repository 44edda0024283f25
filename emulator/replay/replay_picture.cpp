// The picture of emulator/replay/replay_report.h: a frame, its reference, their difference.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "emulator/log/plot.h"
#include "emulator/replay/replay_report.h"

namespace narpa {
namespace {

using namespace plot;

constexpr int kGap = 12, kTop = 64, kBottom = 12;
constexpr int kPanelWidth = 640;  // wider images are halved until they fit
constexpr double kShown = 0.98;   // of the differences, that the colours' range holds

std::uint8_t srgb_byte(double linear) {
    const double l = std::clamp(linear, 0.0, 1.0),
                 s = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    return static_cast<std::uint8_t>(std::lround(255 * s));
}

template <class Colour>
cv::Mat paint(int width, int height, Colour&& colour) {
    cv::Mat out(height, width, CV_8UC3);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            out.at<cv::Vec3b>(y, x) =
                colour(static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
    return out;
}

cv::Mat as_seen(const RadianceImage& image, double full_scale) {
    return paint(image.width, image.height, [&](std::size_t i) {
        const Rgb& p = image.pixels[i];
        const auto byte = [&](float band) { return srgb_byte(static_cast<double>(band) / full_scale); };
        return cv::Vec3b(byte(p.z), byte(p.y), byte(p.x));
    });
}

/// Red: too bright; blue: too dark; white: as the reference.
cv::Vec3b signed_colour(double part) {
    const double p = std::clamp(part, -1.0, 1.0);
    const auto faded = static_cast<std::uint8_t>(std::lround(255 * (1 - std::abs(p))));
    return p > 0 ? cv::Vec3b(faded, faded, 255) : cv::Vec3b(255, faded, faded);
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

Status write_picture(const std::string& path, const std::string& title, const ReplayedFrame& frame,
                     const RadianceImage& picture, const RadianceImage& reference) {
    const ImageDifference& d = frame.compared->difference;
    const Differences off = differences(picture, reference, d.full_scale);
    const std::array<cv::Mat, 3> panels{
        as_seen(picture, d.full_scale), as_seen(reference, d.full_scale),
        paint(picture.width, picture.height, [&](std::size_t i) { return signed_colour(off.of[i] / off.range); })};
    const FrameLedger& l = frame.logged.ledger;
    const std::array<std::string, 3> captions{
        fmt::format("frame {}: {}, {:.2f} spp, RMSE {:.3f} %", l.frame, kStepNames[l.step], l.samples_per_pixel,
                    100 * d.rmse / d.full_scale),
        "reference", fmt::format("difference: white 0, red +{0:.2g} %, blue -{0:.2g} %", 100 * off.range)};
    int parts = 1;
    while (picture.width / parts > kPanelWidth) parts *= 2;
    const int width = std::max(1, picture.width / parts), height = std::max(1, picture.height / parts);
    const int column = std::max(width, 320) + kGap;
    cv::Mat sheet(kTop + height + kBottom, kGap + 3 * column, CV_8UC3, cv::Scalar::all(255));
    text(sheet, title, {kGap, 24}, kTitleSize, 0, kInk);
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const cv::Point at(kGap + static_cast<int>(i) * column, kTop);
        cv::Mat shown;
        cv::resize(panels[i], shown, {width, height}, 0, 0, cv::INTER_AREA);
        shown.copyTo(sheet(cv::Rect(at, shown.size())));
        text(sheet, captions[i], {at.x, kTop - 10}, kTextSize, 0, kInk);
        cv::rectangle(sheet, cv::Rect(at, shown.size()), kInk, 1);
    }
    return write_png(path, sheet);
}

}  // namespace narpa
