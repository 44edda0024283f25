/// renderer/film/frame_error.h - the standard error of a frame, estimated from its own samples.
///
/// Sums over all pixels, by how each was made: its centre, one random sample (g_buffer.h estimates the error of
/// both), or two samples and more. Of the latter, each doubling of the samples moves the mean by a step whose mean
/// square is v(n/2) - v(n), v(n) being the variance of the mean of n: the halves of an Owen-scrambled sequence are
/// each as good as the first, and the whole is their mean (A. Owen, "Scrambled net variance for integrals of smooth
/// functions", Ann. Stat. 25, 1997). If v falls by the same ratio q each time, what is left after the last step is
/// q / (1 - q) of it: all of it for independent samples (q = 1/2), 0.55 of it for edges (q = 2^-1.5). The last two
/// steps, squared and summed over the pixels, give the ratio.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/film/g_buffer.h"
#include "renderer/film/pixel_samples.h"

namespace narpa {

/// How the variance of pixels' means, together, compares with that of as many independent samples: 1 for noise,
/// less where samples are stratified. From the last two steps of pixels with four samples or more.
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
    /// A tile whose pixels show their centres, and that stands for so many.
    void add_centres(const TileContrast& contrast, double tiles = 1) noexcept;
    /// A tile whose pixels have samples, as many as each has; a pixel without any shows its centre. `contrast`:
    /// null where all have two samples or more.
    void add_tile(const TileContrast* contrast, const PerPixel<PixelMeans>& means) noexcept;
    /// A pixel of two samples or more.
    void add(const PixelMeans& means) noexcept;
    FrameError& operator+=(const FrameError& b) noexcept;

    /// Of the mean band, root mean square over this many pixels; those that were not added have none.
    [[nodiscard]] double standard_error(std::size_t pixels) const noexcept;

private:
    static constexpr std::size_t kDoublings = 24;
    struct Steps {
        double last = 0, before = 0;  ///< squared
    };

    /// Of one part of the light.
    struct Part {
        std::array<Steps, kDoublings> steps{};
        std::array<double, kDoublings> shares{};  ///< of the last power of two in the number of samples, summed
        std::array<std::uint64_t, kDoublings> pixels{};

        void add(const PixelMean& mean) noexcept;
        Part& operator+=(const Part& b) noexcept;
        [[nodiscard]] double squared_error() const noexcept;
    };

    double from_contrasts_ = 0;  ///< squared errors
    Part direct_, path_;
};

}  // namespace narpa
