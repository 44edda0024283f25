/// renderer/optics/image_optics.h - the optics of a camera at work on its images; optical_effect.h has the order.
#pragma once

#include <cstddef>
#include <vector>

#include "base/radiance_image.h"
#include "renderer/optics/point_spread.h"
#include "renderer/projection/camera_model.h"

namespace narpa {

/// Constructed once per camera. If the camera has none of these effects, nothing is computed or allocated.
class ImageOptics {
public:
    ImageOptics(const Optics& optics, const ImagePlane& plane);

    [[nodiscard]] bool any() const noexcept { return !terms_.empty() || !effects_.empty(); }
    /// Applies vignetting and point spread; copies if there is neither. Both images have the camera's size and are
    /// distinct. Beyond the border, the border pixels are repeated. Same bytes on any number of threads; allocates
    /// nothing; runs on the calling thread's TBB arena. Rows without light cost nothing.
    void apply(const RadianceImage& in, RadianceImage& out) noexcept;
    /// The effects on the whole image, on its present light: the last step before the detector.
    void add_effects(const ImageExposure& exposure, RadianceImage& image) noexcept;
    /// Share of the light that vignetting leaves at the pixel nearest to an image point.
    [[nodiscard]] float gain_at(const ImagePoint& p) const noexcept;

private:
    struct Range {
        int first = 0, end = 0;
        [[nodiscard]] bool empty() const noexcept { return first >= end; }
    };
    void pad_row(const RadianceImage& in, int y) noexcept;
    void find_lit_rows() noexcept;
    void filter_row(const SeparableFilter::Term& term, int y) noexcept;
    void filter_columns(const SeparableFilter::Term& term, int block, Range rows,
                        RadianceImage& out) const noexcept;
    [[nodiscard]] float* padded_row(int y) noexcept { return &padded_[static_cast<std::size_t>(y) * padded_step_]; }
    [[nodiscard]] std::size_t index_of(int y, int block) const noexcept;

    int width_ = 0, height_ = 0, radius_ = 0;
    std::vector<float> gain_;  ///< vignetting of each pixel; empty: 1
    std::vector<SeparableFilter::Term> terms_;
    // Rows are filtered in blocks; the last one may end beyond the row.
    int blocks_ = 0;
    std::size_t padded_step_ = 0, step_ = 0;  ///< numbers from one row to the next
    std::vector<float> padded_, rows_;        ///< the image with its borders, and filtered along x
    std::vector<Range> lit_blocks_;           ///< of each row of `rows_`; the other blocks are 0
    std::vector<Range> lit_rows_;             ///< of each block
    std::vector<std::unique_ptr<ImageEffect>> effects_;
};

}  // namespace narpa
