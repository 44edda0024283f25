/// estimator/marks/mark_matcher.h - which blob of an image is which lamp or reflector, near a guess of the pose.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "estimator/marks/blob_finder.h"
#include "renderer/scene/mark.h"

namespace narpa {

struct MarkMatches {
    std::vector<std::optional<Blob>> blobs;  ///< of each mark
    int matched = 0;
    int in_view = 0;  ///< marks that face the camera and lie inside the image at the guess
    /// False where blobs at random places could have agreed as well.
    bool reliable = false;
    Rigid3 T_camera_body{};  ///< fitted to the matched blobs and, weakly, to the guess
};

/// Variance of the centroid of a disc of this radius in an image of one sample a pixel, px^2: the pixels of its rim
/// are full or empty by chance.
[[nodiscard]] double variance_of_disc(double radius_px);

/// Two blobs near where the guess has two marks give a pose, with the guess as a weak prior; the pose that explains
/// most marks is taken (Fischler and Bolles 1981, without chance). Blobs are searched ever further from the guess,
/// until half of the marks in view are found and the agreement is too good for chance: fewer than 1 in 1000 such
/// agreements are expected among blobs of this density (Desolneux, Moisan and Morel, "Meaningful alignments",
/// 2000).
[[nodiscard]] MarkMatches match_marks(std::span<const Mark* const> marks, const MeasuredImage& image,
                                      const SensorModel& sensor, const CameraModel& model, const Rigid3& guess);

}  // namespace narpa
