/// estimator/pnp/pnp_points.h - correspondences: points of the body and their pixels.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/least_squares/levenberg_marquardt.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {

/// Cauchy's loss grows logarithmically beyond `scale`, in standard deviations.
struct RobustLoss {
    enum class Kind : std::uint8_t { none, cauchy };
    Kind kind = Kind::none;
    double scale = 2.5;

    /// rho(s) of a residual's squared normalised length s = r' C^-1 r; rho(s) = s - ... near 0.
    [[nodiscard]] double cost(double s) const {
        return kind == Kind::none ? s : scale * scale * std::log1p(s / (scale * scale));
    }
    /// rho'(s): the weight of iteratively reweighted least squares.
    [[nodiscard]] double weight(double s) const {
        return kind == Kind::none ? 1 : scale * scale / (scale * scale + s);
    }
};
using Loss = RobustLoss::Kind;

struct Pixel {
    double u = 0, v = 0;

    friend constexpr bool operator==(const Pixel&, const Pixel&) = default;
};

/// Of one measured pixel: variances and covariance, px^2.
struct PixelCovariance {
    double uu = 1, uv = 0, vv = 1;
};

/// N points: body_m[i] is seen at pixels[i]. `covariance_px2`: one for each, or empty, and then sigma_px holds for
/// u and v of all. Every pixel's ray has z > 0.
struct PnpInput {
    const CameraModel* camera = nullptr;  ///< outlives the input, as the spans do
    std::span<const Vec3> body_m;
    std::span<const Pixel> pixels;
    double sigma_px = 1;
    std::span<const PixelCovariance> covariance_px2{};
};

enum class PnpStatus : std::uint8_t {
    converged,
    no_convergence,   ///< not within the iterations
    degenerate,       ///< the points leave some direction of the pose undetermined
    behind_camera,    ///< the start pose has a point behind the camera, or no pose without one was found
    too_few_points,   ///< less than 3
    too_many_points,  ///< more than the solver was made for
    sizes_differ,     ///< points, pixels and covariances differ in number
    not_finite,       ///< NaN or infinity in a point, a pixel or the pose to start from
    bad_camera,       ///< a focal length is not above 0, or a number is not finite
    bad_noise,        ///< sigma_px is not above 0, or a covariance not positive definite
    no_consensus,     ///< no pose agrees with enough of the points
};
/// What was wrong and what was expected, as a sentence.
[[nodiscard]] const char* to_text(PnpStatus status);

/// `converged` where the input is usable, else what is wrong with it.
[[nodiscard]] PnpStatus check(const PnpInput& input);

/// The state of the solver: attitude, and position of the points' centroid, so that rotation and translation are
/// nearly independent wherever the body's origin lies.
struct CentredPose {
    Quat q{};
    Vec3 centroid_m{};  ///< in the camera's frame
};

/// Correspondences prepared for the solver: centred, normalised, whitened, in groups of eight for vector code. Sums
/// have the same order on every processor.
class PnpPoints {
public:
    /// Room for so many points; `assign` allocates nothing up to this number.
    explicit PnpPoints(std::size_t points_max);

    /// `input` must have passed check().
    void assign(const PnpInput& input);
    /// Only the points whose flag is not 0; one flag for each.
    void assign(const PnpInput& input, std::span<const std::uint8_t> chosen);

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t capacity() const noexcept { return groups_.size() * kGroup; }
    [[nodiscard]] const Vec3& centroid_body_m() const noexcept { return centroid_; }

    /// Point i relative to the centroid, body axes; and where its pixel's ray meets the plane z = 1.
    [[nodiscard]] Vec3 centred_body_m(std::size_t i) const {
        const Group& g = groups_[i / kGroup];
        return {g.x[i % kGroup], g.y[i % kGroup], g.z[i % kGroup]};
    }
    [[nodiscard]] Pixel normalised(std::size_t i) const {
        const Group& g = groups_[i / kGroup];
        return {g.u[i % kGroup], g.v[i % kGroup]};
    }

    [[nodiscard]] CentredPose centred(const Rigid3& T_camera_body) const;
    [[nodiscard]] Rigid3 uncentred(const CentredPose& pose) const;
    /// Converts the covariance of a centred pose's error, (rotation, centroid), to that of pose_estimate.h.
    [[nodiscard]] Matrix6 uncentred(const CentredPose& pose, const Matrix6& covariance) const;

    /// Normal equations by (rotation rad, centroid m), both in camera axes and on the left. False where a point is
    /// not in front of the camera.
    [[nodiscard]] bool evaluate(const CentredPose& pose, const RobustLoss& loss, NormalEquations& out) const;

    /// sum of min(s, s_max) over the points, s = r' C^-1 r; a point that is not in front of the camera counts
    /// s_max.
    [[nodiscard]] double truncated_cost(const CentredPose& pose, double s_max) const;
    /// s of every point, into `out`; infinite where a point is not in front of the camera.
    void squared_residuals(const CentredPose& pose, std::span<double> out) const;

    static constexpr std::size_t kGroup = 8;
    struct alignas(64) Group {
        using Lanes = std::array<double, kGroup>;
        Lanes x, y, z;        // body point, relative to the centroid
        Lanes u, v;           // where the pixel's ray meets the plane z = 1
        Lanes l00, l10, l11;  // whitened residual = (l00 ru + l10 rv, l11 rv); 0 for padding
    };

private:
    template <class Chosen>
    void assign_if(const PnpInput& input, const Chosen& chosen);
    template <class Model>
    void put(std::size_t i, const PnpInput& input, const Model& model, std::size_t point);
    void pad();

    std::size_t size_ = 0;
    Vec3 centroid_{};
    double rounding_ = 0;  ///< NormalEquations::rounding
    std::vector<Group> groups_;
};

using Matrix26 = UnalignedMatrix<2, 6>;

[[nodiscard]] inline UnalignedMatrix<2, 3> to_eigen(const ProjectionJacobian& J) {
    UnalignedMatrix<2, 3> m;
    m << J.x.x, J.x.y, J.x.z, J.y.x, J.y.y, J.y.z;
    return m;
}

/// Jacobian of the image point of `body_m`, which must have one, by the pose's error (pose_estimate.h): px per
/// (rad, m).
[[nodiscard]] inline Matrix26 reprojection_jacobian(const CameraModel& model, const Rigid3& T_camera_body,
                                                    const Vec3& body_m) {
    const Vec3 a = T_camera_body.q * body_m;
    const ProjectionJacobian J = model.jacobian(a + T_camera_body.t);
    Matrix26 m;
    m.leftCols<3>() << to_eigen(cross(a, J.x)).transpose(), to_eigen(cross(a, J.y)).transpose();
    m.rightCols<3>() = to_eigen(J);
    return m;
}

}  // namespace narpa
