/// estimator/features/feature_matcher.h - the same points in two pictures: the view at a guess, and the frame.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Light as eight bits a pixel, row-major, in steps of equal noise: the generalised Anscombe transform (Murtagh,
/// Starck and Bijaoui 1995) of DN, so that a step in the dark, where rounding hides it, weighs no more than one in
/// the light.
struct TonedImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
};

/// One for a frame and for the views that it is compared with.
class ToneScale {
public:
    /// 255 stands for nearly the brightest of the frame.
    ToneScale(const MeasuredImage& frame, const SensorModel& sensor);

    [[nodiscard]] TonedImage toned(const MeasuredImage& frame) const;
    [[nodiscard]] TonedImage toned(const RadianceImage& view) const;
    /// Variance of a pixel of a toned frame, in its own steps: the sensor's noise, and rounding to eight bits.
    [[nodiscard]] double variance() const;

private:
    [[nodiscard]] double stabilised(double dn) const;
    [[nodiscard]] std::uint8_t tone(double dn) const;

    SensorModel sensor_;
    double black_ = 0, steps_ = 1;  ///< 255 / (top - black), stabilised
};

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

/// While it lives OpenCV uses the calling threads alone, in the whole process; then as many as before.
class OnePictureThread {
public:
    OnePictureThread();
    ~OnePictureThread();
    OnePictureThread(const OnePictureThread&) = delete;
    OnePictureThread& operator=(const OnePictureThread&) = delete;

private:
    int before_;
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
