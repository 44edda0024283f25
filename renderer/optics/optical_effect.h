/// renderer/optics/optical_effect.h - effects of a camera's optics that scenes may name, one row each.
///
/// A new effect on the image is an OpticalEffect in a file of its own, with its row, and a line in
/// optics_kinds.cpp. Light becomes an image in this order:
///
///   1. rays start on the aperture of the thin lens                Optics::lens
///   2. each pixel is dimmed                                       OpticalEffect::transmission
///   3. the point spread function blurs                            Optics::point_spread
///   4. stars are added, which have been dimmed and blurred alike
///   5. effects act on the whole image, one after another          ImageEffect
///   6. the detector takes the image                               renderer/detector/detector_stage.h
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "base/camera_pose.h"
#include "base/radiance_image.h"
#include "renderer/detector/detector_settings.h"
#include "renderer/keys/keys.h"
#include "renderer/optics/optics.h"

namespace narpa {

class TableReader;

/// The Sun of a scene, where its light falls on the lens.
class SunOnLens {
public:
    SunOnLens(const Vec3& direction, double irradiance_w_m2)
        : direction_(direction), irradiance_w_m2_(irradiance_w_m2) {}
    virtual ~SunOnLens() = default;

    [[nodiscard]] const Vec3& direction() const noexcept { return direction_; }  ///< towards it: unit, world
    [[nodiscard]] double irradiance_w_m2() const noexcept { return irradiance_w_m2_; }
    /// Share of its light that reaches a point (world) at mid-exposure, band by band: 0 where a body occludes its
    /// centre, and less than 1 through a medium.
    [[nodiscard]] virtual Rgb transmittance(const Vec3& point) const noexcept = 0;

private:
    Vec3 direction_;
    double irradiance_w_m2_;
};

/// What one frame's effects follow from, beside its light.
struct ImageExposure {
    const CameraPose& pose;
    const SunOnLens* sun = nullptr;  ///< null: the scene has none
};

/// An effect at work on the images of one camera.
class ImageEffect {
public:
    virtual ~ImageEffect() = default;
    /// On the calling thread's TBB arena: the same bytes on any number of threads. Allocates nothing.
    virtual void apply(const ImageExposure& exposure, RadianceImage& image) noexcept = 0;
};

/// An effect as a scene describes it. Functions that it does not need do nothing.
class OpticalEffect {
public:
    virtual ~OpticalEffect() = default;
    /// Whether it dims pixels by `transmission`, the share of the light at an angle from the optical axis.
    [[nodiscard]] virtual bool vignettes() const noexcept { return false; }
    [[nodiscard]] virtual double transmission(double /*angle_rad*/) const noexcept { return 1; }
    /// Null: it does not act on the whole image.
    [[nodiscard]] virtual std::unique_ptr<ImageEffect> make(const ImagePlane& plane) const;
    /// Whether a pixel gets light of others.
    [[nodiscard]] virtual bool spreads_light() const noexcept { return false; }
    /// `scaled` of optics.h; null: it stays the same.
    [[nodiscard]] virtual std::shared_ptr<const OpticalEffect> scaled(double factor) const;
};

/// What the readers of optics need of the rest of the scene.
struct OpticsContext {
    ImagePlane plane{};
    Detector* detector = nullptr;  ///< of the same camera; null: none. A lens may set its f-number
    bool has_sun = false;
    /// The image of a point in the file that a key names; null if it cannot be read, which is noted as a problem.
    std::function<std::shared_ptr<PointSpreadImage>(TableReader& table, const std::string& key)> read_image{};
};

struct OpticsKind {
    std::span<const TableKey> keys{};  ///< of [[camera]]
    void (*read)(TableReader& camera, const OpticsContext& context, Optics& optics) = nullptr;
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const OpticsKind* const> optics_kinds();

extern const TableKeys kOpticsKeys;

/// The optics of a camera, whose projection and detector come first.
[[nodiscard]] Optics read_optics(TableReader& camera, const OpticsContext& context,
                                 std::span<const OpticsKind* const> kinds = optics_kinds());

}  // namespace narpa
