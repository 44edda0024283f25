/// renderer/camera/image_optics.h - what a lens does to the image beyond its projection: vignetting, point spread
/// and veiling glare, in this order.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/camera/point_spread.h"
#include "renderer/image/radiance_image.h"

namespace narpa {

/// Made once for a camera. Where the camera names none of it, nothing is computed and nothing kept.
class ImageOptics {
public:
    explicit ImageOptics(const Camera& camera);

    [[nodiscard]] bool any() const noexcept { return any_; }
    /// Vignetting and point spread; where there is neither, a copy. Both images have the camera's size and are not
    /// the same. Beyond the border the image is taken to go on as it ends. Same bytes on any number of threads;
    /// allocates nothing; runs on the calling thread's TBB arena. Rows without light cost nothing.
    void apply(const RadianceImage& in, RadianceImage& out) noexcept;
    /// Veiling glare of the light that the image has by now; then it is what reaches the detector.
    void add_veil(RadianceImage& image) const noexcept;
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
    std::vector<float> gain_;  ///< of each pixel; empty: 1
    SeparableFilter filter_;
    std::vector<Rgb> padded_, rows_;  ///< the image with its borders, and filtered along x
    std::vector<Extent> lit_;         ///< of each row of `rows_`
};

}  // namespace narpa
