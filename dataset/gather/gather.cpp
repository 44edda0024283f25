#include "dataset/gather/gather.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/file_bytes.h"
#include "dataset/gather/annotations.h"
#include "dataset/gather/contact_sheet_document.h"
#include "dataset/gather/statistics.h"
#include "plot/plot.h"

namespace narpa::dataset {
namespace {

using nlohmann::json;

Status write_json(const std::string& folder, const std::string& name, const json& document) {
    return write_whole_text(folder + "/" + name, document.dump() + "\n");
}

Status check_complete(const std::string& folder) {
    const auto plan = plan_shard(folder, {});
    if (!plan) return plan.error();
    if (plan->missing.empty()) return Ok{};
    return Error{fmt::format("{} of {} images are missing, image {} first: expected all before they are gathered",
                             plan->missing.size(), plan->images, plan->missing.front()),
                 folder, 0, 0, ErrorKind::failed};
}

}  // namespace

Result<json> read_label(const std::string& folder, std::uint32_t image) {
    const std::string path = folder + "/" + image_file(kLabelOutput, image);
    const auto text = read_file(path);
    if (!text) return text.error();
    json label = json::parse(*text, nullptr, false);
    if (!label.is_object()) return Error{"is not the label of an image, expected a JSON object", path};
    return label;
}

Status gather(const std::string& folder, std::vector<std::string>& warnings) {
    const auto manifest = read_manifest(folder);
    if (!manifest) return manifest.error();
    if (auto complete = check_complete(folder); !complete) return complete;
    CocoDocument coco;
    DatasetStatistics statistics;
    ContactSheetDocument sheet(folder, manifest->images);
    json speed = json::array(), camera;
    for (std::uint32_t image = 0; image < manifest->images; ++image) {
        const auto label = read_label(folder, image);
        if (!label) return label.error();
        try {
            coco.add(*label);
            statistics.add(*label);
            speed.push_back(speed_entry(*label));
            if (image == 0) camera = speed_camera(*label);
            if (auto added = sheet.add(*label); !added) return added;
        } catch (const json::exception& e) {
            return Error{fmt::format("is not the label of an image: {}", e.what()),
                         folder + "/" + image_file(kLabelOutput, image)};
        }
    }
    if (auto good = write_json(folder, "coco.json", coco.document()); !good) return good;
    if (camera.is_null()) {
        warnings.emplace_back(
            "camera.json and train.json are not written: OpenCV has no name for the camera's "
            "projection, and their readers use OpenCV's");
    } else {
        if (auto good = write_json(folder, "camera.json", camera); !good) return good;
        if (auto good = write_json(folder, "train.json", speed); !good) return good;
    }
    const std::string title = fmt::format("{} images", manifest->images);
    if (auto good = write_plot(folder + "/statistics.png", statistics.document(title)); !good) return good;
    return write_plot(folder + "/contact_sheet.png", sheet.document());
}

}  // namespace narpa::dataset
