/// estimator/features/feature_matcher.h - the same points in two pictures: the view at a guess, and the frame.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/trace/camera_image.h"

namespace narpa {

/// Eight bits a pixel, row-major: the square root of the light, so that shot noise is the same everywhere and what
/// lies in the dark shows. 255 is `top`.
struct TonedImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
};

/// DN that stands at the top of the scale for both pictures: nearly the brightest of the frame.
[[nodiscard]] double tone_top_dn(const MeasuredImage& frame, const SensorModel& sensor);
[[nodiscard]] TonedImage toned(const MeasuredImage& frame, const SensorModel& sensor, double top_dn);
[[nodiscard]] TonedImage toned(const RadianceImage& view, const SensorModel& sensor, double top_dn);

enum class FeatureKind : std::uint8_t {
    sift,     ///< Lowe 2004
    akaze,    ///< Alcantarilla et al. 2013
    orb,      ///< Rublee et al. 2011
    corners,  ///< minimum eigenvalue (Shi and Tomasi 1994), followed by pyramidal optical flow (Bouguet 2001)
};
[[nodiscard]] std::string_view name(FeatureKind kind) noexcept;

/// Pixels; the centre of the top-left one is (0, 0).
struct FeatureMatch {
    double view_u = 0, view_v = 0;
    double frame_u = 0, frame_v = 0;
};

class FeatureMatcher {
public:
    /// `most`: features that are looked for in each picture.
    FeatureMatcher(FeatureKind kind, int most);
    ~FeatureMatcher();
    FeatureMatcher(FeatureMatcher&&) noexcept;
    FeatureMatcher& operator=(FeatureMatcher&&) noexcept;

    [[nodiscard]] FeatureKind kind() const noexcept;
    /// Descriptors pass Lowe's ratio test and match both ways; corners are followed there and back. `on_target`:
    /// where features of the view may lie, non-zero, as large as the view.
    [[nodiscard]] std::vector<FeatureMatch> match(const TonedImage& view, const TonedImage& frame,
                                                  const std::vector<std::uint8_t>& on_target);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
