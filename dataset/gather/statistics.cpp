#include "dataset/gather/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <numeric>

namespace narpa::dataset {
namespace {

using nlohmann::json;

constexpr int kBins = 24;

json describe(const std::string& label, const std::vector<double>& values, bool logarithmic = false) {
    const Histogram1d h = histogram_of(values, kBins, logarithmic);
    json out{{"label", label}, {"logarithmic", logarithmic}, {"edges", h.edges}, {"counts", h.counts}};
    if (values.empty()) return out;
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    out["least"] = *low, out["greatest"] = *high;
    out["mean"] = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    return out;
}

}  // namespace

Histogram1d histogram_of(std::span<const double> values, int bins, bool logarithmic) {
    Histogram1d h;
    if (values.empty()) return h;
    const auto scaled = [&](double v) { return logarithmic ? std::log(v) : v; };
    const auto [least, greatest] = std::ranges::minmax_element(values);
    const double low = scaled(*least), high = scaled(*greatest), width = (high - low) / bins;
    for (int i = 0; i <= bins; ++i) {
        const double edge = low + i * width;
        h.edges.push_back(logarithmic ? std::exp(edge) : edge);
    }
    h.counts.resize(static_cast<std::size_t>(bins));
    for (const double v : values) {
        const double bin = width > 0 ? (scaled(v) - low) / width : 0;
        ++h.counts[static_cast<std::size_t>(std::clamp(bin, 0.0, bins - 1.0))];
    }
    return h;
}

void DatasetStatistics::add(const json& label) {
    ++images_;
    range_m_.push_back(label.at("range_m").get<double>());
    if (const json& phase = label.at("phase_deg"); !phase.is_null()) phase_deg_.push_back(phase.get<double>());
    brightness_.push_back(label.at("brightness").get<double>());
    visible_part_.push_back(label.at("visible_part").get<double>());
    const json& camera = label.at("camera");
    const double pixels = camera.at("width").get<double>() * camera.at("height").get<double>();
    for (const json& body : label.at("bodies")) {
        if (body.at("id") != label.at("target_id")) continue;
        const auto area = body.at("area_px").get<double>();
        target_share_.push_back(area / pixels);
        if (area == 0) ++empty_;
    }
}

json DatasetStatistics::document(const std::string& title) const {
    return {{"plot", "dataset"},
            {"title", title},
            {"images", images_},
            {"empty_images", empty_},
            {"empty_share", images_ > 0 ? static_cast<double>(empty_) / static_cast<double>(images_) : 0},
            {"histograms",
             {{"range_m", describe("range, m", range_m_, true)},
              {"phase_deg", describe("phase angle, deg", phase_deg_)},
              {"brightness", describe("mean of the image, share of full scale", brightness_)},
              {"visible_part", describe("visible part of the target", visible_part_)},
              {"target_share", describe("share of pixels that show the target", target_share_)}}}};
}

}  // namespace narpa::dataset
