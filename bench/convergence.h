/// bench/convergence.h - how the error of a Monte Carlo image falls with the number of samples: its
/// statistics.
///
/// Series of images of one view, rendered with independent random numbers, are compared with a reference that was
/// rendered the same way with many more samples. Sums are double. Values are radiances, W m^-2 sr^-1, each band of
/// each pixel separately.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "base/vec3.h"

namespace narpa {

struct Estimate {
    double value = 0, standard_error = 0;
    /// How many standard errors the value is off zero; 0 where both are 0.
    [[nodiscard]] double sigmas() const noexcept;
};

/// Means of independent images of the same size: of all, and of each half (every other one). The difference of the
/// halves is noise.
class ImageMean {
public:
    explicit ImageMean(std::size_t pixels)
        : halves_{std::vector<double>(3 * pixels), std::vector<double>(3 * pixels)} {}
    void add(std::span<const Rgb> image);

    [[nodiscard]] std::size_t pixels() const noexcept { return halves_[0].size() / 3; }
    [[nodiscard]] std::size_t count() const noexcept { return levels_.size(); }
    [[nodiscard]] double mean(std::size_t value) const noexcept;
    /// Of the first, third ... image (0) or of the others (1).
    [[nodiscard]] double mean_of_half(std::size_t half, std::size_t value) const noexcept {
        return halves_[half][value];
    }
    /// An estimate of the variance of `mean`, without bias but with a single degree of freedom; at least two
    /// images.
    [[nodiscard]] double variance_of_mean(std::size_t value) const noexcept;
    /// Averaged over the values.
    [[nodiscard]] double variance_of_mean() const noexcept;
    /// Mean of all values; its standard error from the scatter of the images' own means.
    [[nodiscard]] Estimate level() const noexcept;

private:
    [[nodiscard]] double share(std::size_t half) const noexcept;

    std::array<std::vector<double>, 2> halves_;
    std::vector<double> levels_;  ///< mean of each image
};

/// The error at one number of samples a pixel.
struct ErrorRow {
    int spp = 0;
    std::size_t images = 0;
    Estimate rmse;  ///< over pixels and bands, the reference's own noise taken out
    /// The same of errors in parts of the pixel's own radiance (or of a hundredth of the mean level, where that is
    /// more): the brightest edges dominate RMSE; this weighs all parts of the image.
    Estimate relative_rmse;
    Estimate bias;  ///< mean error over pixels, bands and images; the reference's own error is part of its own
    /// Mean over pixels of the squared bias of each, which finds what cancels over the image: the product of the
    /// errors of two halves of the images, so it has no bias of its own and may be negative. Its standard error
    /// takes pixels as independent.
    Estimate pixel_bias_squared;
};

/// Compares images with a reference (of at least two images), which must outlive it.
class ErrorAgainst {
public:
    explicit ErrorAgainst(const ImageMean& reference);
    void add(std::span<const Rgb> image);
    /// At least two images.
    [[nodiscard]] ErrorRow row(int spp) const;

private:
    const ImageMean& reference_;
    std::vector<double> weights_;  ///< of the squared relative error
    ImageMean images_;
    std::vector<double> squared_, squared_relative_;  ///< mean of each image, the reference's variance taken out
};

/// Slope of log(error) against log(spp): -1/2 for independent samples, steeper for low-discrepancy ones. Least
/// squares, weighted by the errors of the rows; its standard error from theirs or, where that is more, from the
/// scatter of the rows about the line. Rows whose error is 0 are left out; 0 for fewer than two.
[[nodiscard]] Estimate fit_slope(std::span<const ErrorRow> rows, Estimate ErrorRow::*error = &ErrorRow::rmse);

/// What is wrong with a convergence, one sentence each: a bias beyond three standard errors, an error (absolute or
/// relative) that falls with a slope shallower than -0.47. Empty: nothing.
inline constexpr double kBiasSigmasMax = 3, kSlopeMax = -0.47;
[[nodiscard]] std::vector<std::string> convergence_faults(std::span<const ErrorRow> rows);

}  // namespace narpa
