/// renderer/optics/image_optics.h - the optics of a camera at work on its images; optical_effect.h has the order.
#pragma once

#include <cstdint>
#include <vector>

#include "base/radiance_image.h"
#include "renderer/optics/point_spread.h"
#include "renderer/projection/camera_model.h"

namespace narpa {

/// Constructed once per camera. If the camera has none of these effects, nothing is computed or allocated.
class ImageOptics {
public:
    ImageOptics(const Optics& optics, const ImagePlane& plane);

    [[nodiscard]] bool any() const noexcept { return !filter_.terms.empty() || !effects_.empty(); }
    /// Applies vignetting and point spread; copies if there is neither. Both images have the camera's size and are
    /// distinct. Beyond the border, the border pixels are repeated. Same bytes on any number of threads; allocates
    /// nothing; runs on the calling thread's TBB arena. Rows without light cost nothing.
    void apply(const RadianceImage& in, RadianceImage& out) noexcept;
    /// The effects on the whole image, on its present light: the last step before the detector.
    void add_effects(const ImageExposure& exposure, RadianceImage& image) noexcept;
    /// Share of the light that vignetting leaves at the pixel nearest to an image point.
    [[nodiscard]] float gain_at(const ImagePoint& p) const noexcept;

private:
    struct Extent {
        int first = 0, end = 0;  ///< pixels of a row that may have light
    };
    void pad_row(const RadianceImage& in, int y) noexcept;
    void filter_row(const SeparableFilter::Term& term, int y) noexcept;
    void gather_row(const SeparableFilter::Term& term, int y, float* out) const noexcept;
    [[nodiscard]] Rgb* padded_row(int y) noexcept {
        return &padded_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_ + 2 * filter_.radius)];
    }

    int width_ = 0, height_ = 0;
    std::vector<float> gain_;  ///< vignetting of each pixel; empty: 1
    SeparableFilter filter_;
    std::vector<Rgb> padded_, rows_;  ///< the image with its borders, and filtered along x
    std::vector<Extent> lit_;         ///< of each row of `rows_`
    std::vector<std::unique_ptr<ImageEffect>> effects_;
};

}  // namespace narpa
