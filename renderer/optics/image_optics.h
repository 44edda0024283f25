/// renderer/optics/image_optics.h - effects of a lens besides projection: vignetting, point spread and veiling
/// glare, in this order.
#pragma once

#include <cstdint>
#include <vector>

#include "base/radiance_image.h"
#include "renderer/optics/point_spread.h"

namespace narpa {

/// Constructed once per camera. If the camera has none of these effects, nothing is computed or allocated.
class ImageOptics {
public:
    explicit ImageOptics(const Camera& camera);

    [[nodiscard]] bool any() const noexcept { return any_; }
    /// Applies vignetting and point spread; copies if there is neither. Both images have the camera's size and are
    /// distinct. Beyond the border, the border pixels are repeated. Same bytes on any number of threads; allocates
    /// nothing; runs on the calling thread's TBB arena. Rows without light cost nothing.
    void apply(const RadianceImage& in, RadianceImage& out) noexcept;
    /// Adds veiling glare, computed from the image's present light: the last step but the Sun's ghost before the
    /// detector.
    void add_veiling_glare(RadianceImage& image) const noexcept;
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
    [[nodiscard]] Rgb mean(const RadianceImage& image) const noexcept;

    bool any_ = false;
    int width_ = 0, height_ = 0;
    float veil_ = 0;           ///< share of the light that is spread over the whole image
    std::vector<float> gain_;  ///< vignetting of each pixel; empty: 1
    SeparableFilter filter_;
    std::vector<Rgb> padded_, rows_;  ///< the image with its borders, and filtered along x
    std::vector<Extent> lit_;         ///< of each row of `rows_`
};

}  // namespace narpa
