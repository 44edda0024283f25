/// estimator/search/template_matcher.h - small renders of the target at any attitude, compared with the frame.
///
/// A render is shifted and scaled until the centroid and the RMS radius of its light equal those of the frame's
/// bright region; that yields direction and range for each attitude. In partial phase both are of the lit part
/// alone, and the attitude determines where the unlit part is.
#pragma once

#include <optional>
#include <vector>

#include "estimator/search/frame_view.h"
#include "estimator/view/model_view.h"

namespace narpa {

/// Region that stands out against the frame's background, in sensor pixels.
struct BrightRegion {
    double x = 0, y = 0;  ///< centroid
    int pixels = 0;
};

/// A pose, and the part of the frame's light energy that its render leaves unexplained: 0 none, 1 all.
struct Hypothesis {
    Rigid3 T_camera_target{};
    double misfit = 1;
};

/// Radius of the smaller of two spheres that contain the body: about its origin, and about its bounds' centre.
[[nodiscard]] double apparent_radius_m(const Tracer& tracer, std::size_t body);

/// What a search knows in addition to the frame.
struct SearchView {
    const RenderScene& render_scene;
    Camera camera;  ///< without an embedded line
    std::size_t target = 0;
    BodyPoses at;
    Rigid3 T_world_camera{};
    double range_m = 1, min_m = 0, max_m = 1;  ///< expected range, and its limits

    /// Diameter of the target's bounds in the image, pixels, at the expected range.
    [[nodiscard]] double extent_px() const;
    /// Pose that puts the centre of the target's bounds in this direction, at this distance.
    [[nodiscard]] Rigid3 aimed(const Quat& q_camera_target, const Vec3& direction, double distance_m) const;
};

/// Empty where no pixel stands out.
[[nodiscard]] std::optional<BrightRegion> find_bright_region(const SearchView& known, const MeasuredImage& frame);

class TemplateMatcher {
public:
    /// All references outlive it. `size_px`: approximate size of the target in the renders; `spp`: samples per
    /// pixel.
    TemplateMatcher(const SearchView& known, const FrameView& frame, const BrightRegion& region, double size_px,
                    int spp);

    /// Renders and compares, with its own buffers; one per task.
    class Worker {
    public:
        explicit Worker(const TemplateMatcher& matcher);
        /// At this attitude; the result has the position at which the render matches best.
        [[nodiscard]] Hypothesis compare(const Rigid3& T_camera_target);

    private:
        const TemplateMatcher& m_;
        BodyPoses at_;
        ModelView view_;
        std::vector<double> light_;
    };

private:
    struct Spread {
        double x = 0, y = 0, radius = 0;  ///< of the light: centroid and RMS radius, template pixels
        double energy = 0;
        [[nodiscard]] bool any() const { return radius > 0; }
    };
    [[nodiscard]] bool is_inside(std::size_t p) const;
    [[nodiscard]] double sensor_px(double template_px, int first) const;
    [[nodiscard]] double light_of(const RadianceImage& image, std::size_t p) const;
    [[nodiscard]] double frame_light(double x, double y, double side) const;
    [[nodiscard]] Spread spread(const std::vector<double>& light) const;

    const SearchView& known_;
    const FrameView& frame_;
    SensorModel sensor_;
    NoiseScale noise_;
    double scale_;  ///< template pixels in one of the sensor's
    int side_, left_, top_;
    Camera camera_;
    FrameSettings settings_;
    std::vector<double> background_;
    Spread of_frame_{};
};

}  // namespace narpa
