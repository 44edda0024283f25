/// bench/approach_frames.h - the frames of an approach as a camera exposes them, with their true poses.
#pragma once

#include "bench/approach.h"
#include "estimator/view/measured_image.h"
#include "estimator/view/model_view.h"

namespace narpa {

struct ApproachView {
    Rigid3 truth{};  ///< T_camera_target
    BodyPoses at;    ///< of every body
    MeasuredImage image;
    std::vector<float> variance_dn2;  ///< of the Monte Carlo noise, which no real sensor has
};

class ApproachFrames {
public:
    ApproachFrames(const World& world, const Camera& camera, std::size_t target, const ApproachOptions& options);

    /// Frame k of n.
    const ApproachView& make(int k, int n);
    /// At this range, with the noise and the offsets of this number.
    const ApproachView& make_at(double range_m, std::uint32_t number);

private:
    [[nodiscard]] Rigid3 pose(double range_m, std::uint32_t number) const;

    const ApproachOptions& options_;
    Camera camera_;
    BodyPoses at_;
    SensorModel sensor_;
    ModelView view_;
    std::vector<std::uint8_t> bytes_;
    ApproachView made_;
};

}  // namespace narpa
