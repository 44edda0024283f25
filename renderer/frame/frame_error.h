/// renderer/frame/frame_error.h - the standard error of a frame, estimated from its own samples.
///
/// Sums over all pixels, by their samples: the centre, one random sample (g_buffer.h estimates the error of both),
/// or two samples and more. In the last case each doubling of the samples moves the mean by a step with mean square
/// v(n/2) - v(n), where v(n) is the variance of the mean of n: the halves of an Owen-scrambled sequence are equally
/// good, and the whole is their mean (A. Owen, "Scrambled net variance for integrals of smooth functions", Ann.
/// Stat. 25, 1997). If v falls by the same ratio q each time, the variance left after the last step is q / (1 - q)
/// of that step's mean square: equal to it for independent samples (q = 1/2), 0.55 of it for edges (q = 2^-1.5).
/// The last two steps, squared and summed over the pixels, give the ratio.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/frame/g_buffer.h"
#include "renderer/frame/pixel_samples.h"

namespace narpa {

/// Ratio of the variance of the pixels' means to that of as many independent samples: 1 for noise, less where
/// samples are stratified. From the last two steps of pixels with four samples or more.
class VarianceRatio {
public:
    /// `independent`: variance of the mean if its samples were independent.
    void add(const PixelMean& mean, double independent) noexcept;
    /// At most 1; 1 where no pixel has four samples.
    [[nodiscard]] double value() const noexcept;

private:
    double last_ = 0, before_ = 0;  ///< steps squared
    double independent_ = 0;
};

class FrameError {
public:
    /// Adds a tile whose pixels show their centres, weighted as this many tiles.
    void add_centres(const TileContrast& contrast, double tiles = 1) noexcept;
    /// Adds a tile with any number of samples per pixel; a pixel without any shows its centre. `contrast`: null if
    /// all have two samples or more.
    void add_tile(const TileContrast* contrast, const PerPixel<PixelMeans>& means) noexcept;
    /// Adds a pixel's squared error.
    void add_squared(double error) noexcept { from_contrasts_ += error; }
    /// Adds a pixel of two samples or more.
    void add(const PixelMeans& means) noexcept;
    FrameError& operator+=(const FrameError& b) noexcept;

    /// Root mean square over this many pixels of the error of the mean over bands; pixels that were not added count
    /// as 0.
    [[nodiscard]] double standard_error(std::size_t pixels) const noexcept;

private:
    static constexpr std::size_t kDoublings = 24;
    struct Steps {
        double last = 0, before = 0;  ///< squared
    };

    /// Of one part of the light.
    struct Part {
        std::array<Steps, kDoublings> steps{};
        std::array<double, kDoublings> shares{};  ///< sum of (largest power of two <= n) / n, n samples
        std::array<std::uint64_t, kDoublings> pixels{};

        void add(const PixelMean& mean) noexcept;
        Part& operator+=(const Part& b) noexcept;
        [[nodiscard]] double squared_error() const noexcept;
    };

    double from_contrasts_ = 0;  ///< squared errors
    Part direct_, path_;
};

}  // namespace narpa
