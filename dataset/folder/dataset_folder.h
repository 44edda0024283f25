/// dataset/folder/dataset_folder.h - a data set on disk: its manifest, its files, and what is missing.
///
/// A file is written under a temporary name and then renamed, the label last: where there is a label, the image is
/// complete. So shards may be made at once, on several machines that share the folder, and be interrupted.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/shard.h"
#include "dataset/recipe/recipe.h"

namespace narpa::dataset {

/// dataset.json.
struct Manifest {
    std::uint32_t images = 0;
    Outputs outputs{};
    std::string recipe;             ///< Recipe::text
    std::string scene_fingerprint;  ///< SceneSet::fingerprint
};
[[nodiscard]] Result<Manifest> read_manifest(const std::string& folder);
/// Makes the folders and the manifest, or checks the manifest that is there. A data set may grow: more images than
/// it has are good, fewer are an Error; so are another recipe and other scene files.
[[nodiscard]] Status open_dataset(const std::string& folder, const Manifest& manifest);

/// What a shard, the images of its numbers, still has to do.
struct Plan {
    std::uint32_t images = 0;              ///< of the shard
    std::vector<std::uint32_t> missing{};  ///< those that lack a file
};
/// Reads the folder only: its manifest and which files there are. Errors: those of read_manifest.
[[nodiscard]] Result<Plan> plan_shard(const std::string& folder, const Shard& shard);

/// "images/000012.png": the file of an image, within the folder. `output`: index in kOutputKinds.
[[nodiscard]] std::string image_file(std::size_t output, std::uint32_t image);

/// Calls `write` with a temporary path in the same folder and with the same extension, then renames that file to
/// `path`. No other process sees a part of it.
[[nodiscard]] Status write_whole(const std::string& path, const std::function<Status(const std::string&)>& write);
/// The same of a text.
[[nodiscard]] Status write_whole_text(const std::string& path, const std::string& text);
/// Removes temporary files of images of the shard, which a process that was killed has left.
void remove_leftovers(const std::string& folder, const Shard& shard);

}  // namespace narpa::dataset
