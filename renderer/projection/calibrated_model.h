/// renderer/projection/calibrated_model.h - what the projections with parameters from a calibration share.
#pragma once

#include "renderer/projection/projection_kind.h"

namespace narpa {

/// Image points are fx, fy, cx, cy applied to a point (u', v') that the kind's parameters give; u' = X / Z near the
/// axis, unless pixels_per_radian is overridden.
class CalibratedModel : public CameraModel {
public:
    [[nodiscard]] double pixels_per_radian() const noexcept override { return pinhole_.fx; }
    [[nodiscard]] DirectionCone bounds(const ImageRect& rect) const noexcept override {
        const RectBorder points = border_of(rect);
        Vec3Lanes border;
        directions({}, points.x, points.y, border);
        return cone_about_border(direction(middle(rect)), border);
    }
    [[nodiscard]] std::shared_ptr<const CameraModel> scaled(double x, double y) const override {
        return kind_->make(pinhole_.with_scale(x, y), values_);
    }
    [[nodiscard]] std::shared_ptr<const CameraModel> windowed(double x, double y) const override {
        return kind_->make(pinhole_.with_origin(x, y), values_);
    }
    [[nodiscard]] ProjectionParameters parameters() const override { return {kind_, pinhole_, values_}; }
    /// True if all parameters are finite and the focal lengths positive.
    [[nodiscard]] bool is_valid() const noexcept override {
        for (const double v : values_)
            if (!std::isfinite(v)) return false;
        return pinhole_.is_valid();
    }

protected:
    CalibratedModel(const ProjectionKind& kind, const Pinhole& pinhole, std::span<const double> values)
        : pinhole_(pinhole), kind_(&kind), values_(values.begin(), values.end()) {}

    Pinhole pinhole_;

private:
    const ProjectionKind* kind_;
    std::vector<double> values_;
};

/// What a table without its coefficients is told to have.
inline constexpr std::string_view kCoefficients = "an array of numbers in OpenCV's order";

/// ProjectionKind::make of a model with a constructor from intrinsics and parameters.
template <class Model>
std::shared_ptr<const CameraModel> make_model(const Pinhole& pinhole, std::span<const double> parameters) {
    return std::make_shared<Model>(pinhole, parameters);
}

}  // namespace narpa
