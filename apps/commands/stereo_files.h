/// apps/commands/stereo_files.h - depth maps and point clouds of stereo pairs.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "tracking/stereo_tracker.h"

namespace narpa::cli {

/// What is written of a pair: matches of all pixels on a grid that may show the target.
struct StereoFiles {
    std::vector<std::string> maps;    ///< FILE.pfm, or a picture
    std::vector<std::string> clouds;  ///< FILE.ply, .pcd or .csv
    int grid_px = 4;

    [[nodiscard]] bool any() const { return !maps.empty() || !clouds.empty(); }
    /// Errors: file extensions; makes the folders.
    [[nodiscard]] Status prepare() const;
};

/// A pair whose pose was estimated.
struct MatchedPair {
    const World& world;
    const StereoImages& images;
    const TrackedFrame& tracked;
    std::size_t target;
    const BodyPoses& at;  ///< the truth, for the errors
    bool has_truth = true;
};

/// Matches the grid's pixels near the target, where it was estimated or else guessed to be, and writes the files;
/// `number` goes into their names. Prints what was written. Returns numbers of points and their errors against the
/// truth.
[[nodiscard]] Result<nlohmann::json> write_stereo_files(const StereoFiles& files, const MatchedPair& of,
                                                        std::optional<std::uint32_t> number = {});

}  // namespace narpa::cli
