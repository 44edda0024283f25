#include "dataset/gather/contact_sheet_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/file_bytes.h"
#include "plot/plot.h"
#include "renderer/assets/images/image_reader.h"

namespace narpa::dataset {
namespace {

using nlohmann::json;

constexpr std::uint32_t kTilesMax = 24;
constexpr int kTileWidth_px = 320;

/// The image with every `step`-th pixel, grey or colour, 8 bits as a display shows them.
json thumbnail(const DecodedImage& image, int step) {
    const int width = (image.width + step - 1) / step, height = (image.height + step - 1) / step;
    std::vector<std::uint8_t> pixels;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            for (int c = 0; c < image.channels; ++c) {
                const auto i = (static_cast<std::size_t>(y * step) * static_cast<std::size_t>(image.width) +
                                static_cast<std::size_t>(x * step)) *
                                   static_cast<std::size_t>(image.channels) +
                               static_cast<std::size_t>(c);
                pixels.push_back(srgb_byte(static_cast<double>(image.samples[i]) / image.largest));
            }
    return plot_image(width, height, image.channels, pixels);
}

}  // namespace

struct ContactSheetDocument::Tiles {
    json all = json::array();
};

ContactSheetDocument::ContactSheetDocument(std::string folder, std::uint32_t images)
    : folder_(std::move(folder)),
      stride_(std::max(1u, (images + kTilesMax - 1) / kTilesMax)),
      tiles_(std::make_unique<Tiles>()) {}
ContactSheetDocument::~ContactSheetDocument() = default;

Status ContactSheetDocument::add(const json& label) {
    if (label.at("image").get<std::uint32_t>() % stride_ != 0) return Ok{};
    const std::string path = folder_ + "/" + label.at("file").get<std::string>();
    const auto file = read_file(path);
    if (!file) return file.error();
    const auto image = decode_image(path, {reinterpret_cast<const std::uint8_t*>(file->data()), file->size()});
    if (!image) return image.error();
    if (image->samples.empty()) return Error{"has no integer samples, expected an image of this data set", path};
    const int step = std::max(1, (image->width + kTileWidth_px - 1) / kTileWidth_px);
    json tile{{"image", label.at("image")},     {"pixels", thumbnail(*image, step)},  {"step", step},
              {"range_m", label.at("range_m")}, {"phase_deg", label.at("phase_deg")}, {"keypoints", json::array()},
              {"boxes", json::array()}};
    for (const json& k : label.at("keypoints"))
        if (k.at("state") != "outside") tile["keypoints"].push_back({k.at("px"), k.at("state")});
    for (const json& body : label.at("bodies"))
        if (body.at("id") == label.at("target_id") && !body.at("bbox_px").is_null())
            tile["boxes"].push_back(body.at("bbox_px"));
    tiles_->all.push_back(std::move(tile));
    return Ok{};
}

json ContactSheetDocument::document() const {
    return {{"plot", "contact_sheet"}, {"title", ""}, {"tiles", tiles_->all}};
}

}  // namespace narpa::dataset
