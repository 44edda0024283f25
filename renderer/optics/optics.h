/// renderer/optics/optics.h - the optics of a camera beside its projection, as a scene describes them.
#pragma once

#include <memory>
#include <optional>
#include <vector>

namespace narpa {

class CameraModel;
class OpticalEffect;

/// Thin lens: a point off the focus distance, at depth z, is blurred to a circle of aperture * fx * |1/focus - 1/z|
/// pixels.
struct Lens {
    double aperture_diameter_m = 0;
    double focus_distance_m = 0;  ///< from the lens, along z; infinite is allowed
};

/// Largest reach of the filter of a point spread function, pixels.
inline constexpr int kPointSpreadReach_px = 31;

/// Point spread function of a lens as samples that sum to 1, row by row.
struct PointSpreadImage {
    int width = 0, height = 0;
    double centre_x = 0, centre_y = 0;  ///< where a pinhole images the point; the first sample is at (0, 0)
    std::vector<double> samples;
};

/// The blur of the lens, the same all over the image; point_spread.h.
struct PointSpreadFunction {
    double sigma_px = 0;       ///< of a Gaussian; 0: none
    double cutoff_per_px = 0;  ///< diffraction: pixel pitch / (wavelength * f-number); 0: none
    std::shared_ptr<const PointSpreadImage> image{};
    double samples_per_px = 1;  ///< of the image
};

/// Rays and samples follow lens and point spread; the other effects act on the image alone.
struct Optics {
    std::optional<Lens> lens{};  ///< none: a pinhole
    std::optional<PointSpreadFunction> point_spread{};
    std::vector<std::shared_ptr<const OpticalEffect>> effects{};  ///< in order; optical_effect.h

    /// Whether the light of a pixel depends on that of others.
    [[nodiscard]] bool spreads_light() const noexcept;
};

/// The same optics in front of `factor` times as many pixels along each side of the same field.
[[nodiscard]] Optics scaled(const Optics& optics, double factor);

/// The pixels that optics form an image on.
struct ImagePlane {
    int width = 0, height = 0;
    std::shared_ptr<const CameraModel> model{};
};

}  // namespace narpa
