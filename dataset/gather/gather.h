/// dataset/gather/gather.h - the files of a whole data set, from its images' labels.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "dataset/folder/dataset_folder.h"

namespace narpa::dataset {

/// The label of an image on disk. Errors: no such file; no JSON.
[[nodiscard]] Result<nlohmann::json> read_label(const std::string& folder, std::uint32_t image);

/// Writes coco.json, camera.json and train.json (where OpenCV has a name for the projection), statistics.json with
/// its picture and contact_sheet.png. The same labels give the same bytes, whoever writes them. Errors: an image is
/// missing (failed); a label is no label. `warnings`: what could not be written.
[[nodiscard]] Status gather(const std::string& folder, std::vector<std::string>& warnings);

}  // namespace narpa::dataset
