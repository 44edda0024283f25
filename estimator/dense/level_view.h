/// estimator/dense/level_view.h - one pyramid level: measured and predicted image in a window about the target.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/dense/photometric_fit.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "estimator/view/model_view.h"

namespace narpa {

/// Pixels x .. x + width - 1, y .. y + height - 1.
struct Window {
    int x = 0, y = 0, width = 0, height = 0;
    friend bool operator==(const Window&, const Window&) = default;
};
/// The smallest window that contains both.
[[nodiscard]] Window joined(const Window& a, const Window& b);

/// The window that holds the target's bounds at this pose, with a margin; nothing where they are outside the image
/// or behind the camera.
[[nodiscard]] std::optional<Window> window_about(const Tracer& tracer, const Camera& camera, std::size_t target,
                                                 const Rigid3& T_camera_target);
/// Longest side of the target's bounds in the image, px; the image's own where they reach beyond it.
[[nodiscard]] double extent_px(const Window& window);

/// Signal and Jacobian in a window of the camera's image.
class LevelView {
public:
    /// `render_scene` and `sensor` outlive it. `pixels_averaged`: sensor pixels in each pixel of `camera`.
    LevelView(const RenderScene& render_scene, const Camera& camera, const SensorModel& sensor,
              double pixels_averaged, const Window& window, std::size_t target, const BodyPoses& at);

    [[nodiscard]] const Window& window() const noexcept { return window_; }
    [[nodiscard]] const RowTimes& row_times() const noexcept { return times_; }
    /// Like ModelView::begin_frame; `times`: of the rows of `camera`. `model`: its uncertainty of brightness and
    /// light increases the pixels' expected variance. `T_world_camera`: DenseOptions.
    void begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times,
                     const ModelUncertainty& model, const std::optional<Rigid3>& T_world_camera);
    /// Copies the window from the level's measured image and variance (or none).
    void measure(const MeasuredImage& image, std::span<const float> variance);
    void render(const Rigid3& T_camera_target, const FrameSettings& settings);
    /// After `render` of all pixels with this many samples each: raises each variance to at least that of half a
    /// sample of the contrast with the neighbours. The sample variance of a pixel with few bright samples is
    /// unreliable: stratified samples measure the bright area to about half a sample, so that all may miss it. This
    /// overstates the variance beside edges.
    void allow_for_missed_light(int samples);
    /// Adds light to this frame's latest and later renders, DN.
    void add_light(std::span<const float> signal);
    /// Updates the latest render's signal for a small step of the pose, by the Jacobian.
    void predict(const Vector6& step);
    /// From now on `render` and `differentiate` process only the pixels whose mask is not 0. The others keep their
    /// signal but lose their Jacobian.
    void choose(std::vector<std::uint8_t> pixels);
    void choose_all();
    /// Changes of the latest render's signal, DN, if the target were rotated relative to its light by `turn_rad`,
    /// target axes, and seen at the same pose.
    [[nodiscard]] std::vector<float> change_with_light(const Rigid3& T_camera_target, const FrameSettings& settings,
                                                       const Vec3& turn_rad);
    /// The same for turns by one degree about two axes across the light, by renders with these settings; empty
    /// without a Sun.
    [[nodiscard]] std::vector<std::vector<float>> changes_with_light(const Rigid3& T_camera_target,
                                                                     const FrameSettings& settings);
    /// DN of the target in light that falls on all of its surfaces alike; the brightest is 1. At the latest
    /// render's pose.
    [[nodiscard]] std::vector<float> ambient_light() const;
    /// DN of the light that the target's surfaces reflect to each other, by renders with these settings. With
    /// ambient light, which method path shows as a sky: none in pixels beside dark ones.
    [[nodiscard]] std::vector<float> indirect_light(const Rigid3& T_camera_target, FrameSettings settings);
    /// At the pose of the latest render, for lit pixels.
    void differentiate(const Rigid3& T_camera_target, const FrameSettings& settings, int fineness);
    /// Pose and fineness of this frame's latest Jacobian.
    [[nodiscard]] const std::optional<Rigid3>& differentiated_at() const noexcept { return differentiated_at_; }
    [[nodiscard]] int fineness() const noexcept { return fineness_; }
    /// Normal, camera axes, of a flat face: at least a third of the target's visible surface at the latest render's
    /// pose. Empty: none.
    [[nodiscard]] std::optional<Vec3> flat_face() const;
    /// The latest measured and rendered images and Jacobian.
    [[nodiscard]] PhotometricImages images() const;

private:
    [[nodiscard]] bool is_chosen(std::size_t pixel) const { return chosen_.empty() || chosen_[pixel] != 0; }
    void place(const Rigid3& T_camera_target);
    [[nodiscard]] std::vector<std::uint8_t> lit() const;
    /// DN above black of view_'s latest image.
    [[nodiscard]] std::vector<float> rendered() const;
    void find_clutter();
    void add_shading(const Rigid3& T_camera_target, const FrameSettings& settings);

    const SensorModel& sensor_;
    double pixels_averaged_;
    Window window_;
    std::size_t target_;
    BodyPoses at_;
    ApparentMotion motion_{};
    RowTimes times_{};
    ModelUncertainty model_{};
    std::optional<Rigid3> T_world_camera_;
    const RenderScene& render_scene_;
    ModelView view_;
    ImageDerivative derivative_;
    std::vector<float> measured_, measured_variance_, signal_, signal_variance_;
    std::vector<float> added_;           ///< add_light; empty: none
    std::vector<std::uint8_t> ignored_;  ///< find_clutter; empty: none
    double detail_dn2_ = 0;              ///< by the brightness of this frame's first render
    std::vector<std::uint8_t> measured_clipped_;
    std::vector<PixelDerivative> columns_;
    std::vector<std::uint8_t> chosen_;  ///< empty: all
    std::optional<Rigid3> differentiated_at_;
    int fineness_ = 0;
};

}  // namespace narpa
