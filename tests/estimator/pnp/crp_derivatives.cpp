// Every derivative against automatic differentiation of formulas written down once more.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "estimator/pnp/pnp_refine.h"
#include "tests/estimator/pnp/crp.h"
#include "tests/estimator/pnp/pnp_support.h"

namespace narpa {
namespace {

using Jet3 = ceres::Jet<double, 3>;
using Jet6 = ceres::Jet<double, 6>;
using Jet12 = ceres::Jet<double, 12>;

/// (I + [q x])^-1 (I - [q x]), as the definition has it.
template <class T>
Eigen::Matrix<T, 3, 3> cayley(const Eigen::Matrix<T, 3, 1>& q) {
    Eigen::Matrix<T, 3, 3> Q;
    Q << T(0), -q[2], q[1], q[2], T(0), -q[0], -q[1], q[0], T(0);
    const Eigen::Matrix<T, 3, 3> I = Eigen::Matrix<T, 3, 3>::Identity();
    return Eigen::Matrix<T, 3, 3>(I + Q).inverse() * (I - Q);
}

class CrpDerivatives : public testing::Test {
protected:
    std::mt19937_64 random_{11};
    std::uniform_real_distribution<double> u_{-3, 3};

    Eigen::Vector3d vector() { return {u_(random_), u_(random_), u_(random_)}; }
};

TEST_F(CrpDerivatives, OfTheMatrix) {
    for (int trial = 0; trial < 100; ++trial) {
        const Eigen::Vector3d q = vector();
        const Eigen::Matrix<Jet3, 3, 3> R = cayley<Jet3>({Jet3(q[0], 0), Jet3(q[1], 1), Jet3(q[2], 2)});
        const Eigen::Matrix3d value = crp_matrix(q);
        const auto derivative = crp_matrix_derivative(q);
        for (int i = 0; i < 9; ++i) {
            EXPECT_NEAR(value(i / 3, i % 3), R(i / 3, i % 3).a, 1e-13);
            for (int k = 0; k < 3; ++k) EXPECT_NEAR(derivative(i, k), R(i / 3, i % 3).v[k], 1e-13);
        }
    }
}

TEST_F(CrpDerivatives, OfTheProjectionVector) {
    constexpr double kFocal = 1319;
    for (int trial = 0; trial < 100; ++trial) {
        const Eigen::Vector3d q = vector(), t = vector();
        const Eigen::Matrix<Jet6, 3, 3> R = cayley<Jet6>({Jet6(q[0], 0), Jet6(q[1], 1), Jet6(q[2], 2)});
        const ProjectionVector h = projection_vector(q, t, kFocal);
        const auto J = projection_vector_derivative(q, kFocal);
        for (int i = 0; i < 12; ++i) {
            const Jet6 entry = i % 4 < 3 ? R(i / 4, i % 4) : Jet6(t[i / 4], 3 + i / 4);
            const Jet6 expected = i < 8 ? kFocal * entry : entry;
            EXPECT_NEAR(h[i], expected.a, 1e-10);
            for (int k = 0; k < 6; ++k) EXPECT_NEAR(J(i, k), expected.v[k], 1e-10);
        }
    }
}

TEST_F(CrpDerivatives, OfTheImagePoints) {
    for (int trial = 0; trial < 100; ++trial) {
        ProjectionVector h;
        for (int i = 0; i < 12; ++i) h[i] = u_(random_);
        h[11] = 40;
        const std::vector<Vec3> points = test::random_points(random_, 5, 2);
        const Eigen::VectorXd uv = image_points(h, points);
        const auto J = image_points_derivative(h, points);
        ASSERT_EQ(J.rows(), 10);
        std::array<Jet12, 12> jets;
        for (int i = 0; i < 12; ++i) jets[static_cast<std::size_t>(i)] = Jet12(h[i], i);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vec3& a = points[i];
            const auto row = [&](std::size_t k) {
                return jets[k] * a.x + jets[k + 1] * a.y + jets[k + 2] * a.z + jets[k + 3];
            };
            const std::array<Jet12, 2> expected{row(0) / row(8), row(4) / row(8)};
            for (std::size_t axis = 0; axis < 2; ++axis) {
                const auto at = static_cast<Eigen::Index>(2 * i + axis);
                EXPECT_NEAR(uv[at], expected[axis].a, 1e-13);
                for (int k = 0; k < 12; ++k) EXPECT_NEAR(J(at, k), expected[axis].v[k], 1e-13);
            }
        }
    }
}

/// Whitened residuals of one point by the six numbers of an error, first order being all that matters.
std::array<Jet6, 2> residual(const Pinhole& camera, const CentredPose& pose, const Vec3& centred_m,
                             const Pixel& pixel, const Eigen::Matrix2d& whitening) {
    const Vec3 b = pose.q * centred_m;
    const std::array<Jet6, 3> r{Jet6(0, 0), Jet6(0, 1), Jet6(0, 2)};
    const Jet6 X = b.x + r[1] * b.z - r[2] * b.y + Jet6(pose.centroid_m.x, 3);
    const Jet6 Y = b.y + r[2] * b.x - r[0] * b.z + Jet6(pose.centroid_m.y, 4);
    const Jet6 Z = b.z + r[0] * b.y - r[1] * b.x + Jet6(pose.centroid_m.z, 5);
    const Jet6 du = pixel.u - (camera.fx * X / Z + camera.cx), dv = pixel.v - (camera.fy * Y / Z + camera.cy);
    return {whitening(0, 0) * du + whitening(0, 1) * dv, whitening(1, 0) * du + whitening(1, 1) * dv};
}

TEST_F(CrpDerivatives, OfTheRefinementWithCovariancesAndLosses) {
    const Pinhole camera{1200, 1100, 320.5, 240};
    for (const std::size_t n : {3u, 8u, 21u}) {
        std::vector<Vec3> body = test::random_points(random_, n, 2);
        const Rigid3 T{test::random_attitude(random_), {0.5, -1, 12}};
        std::vector<Pixel> pixels;
        std::vector<PixelCovariance> covariances;
        for (const Vec3& p : body) {
            Pixel pixel = test::project(camera, T * p);
            pixel.u += u_(random_), pixel.v += u_(random_);
            pixels.push_back(pixel);
            const double a = 1.5 + 0.3 * u_(random_), b = 0.2 * u_(random_), c = 1.5 + 0.3 * u_(random_);
            covariances.push_back({a * a + b * b, b * c, c * c});
        }
        PnpPoints points(32);
        points.assign({&camera, body, pixels, 1, covariances});
        const CentredPose pose = points.centred(T);
        for (const Loss kind : {Loss::none, Loss::cauchy}) {
            const RobustLoss loss{kind, 1.7};
            NormalEquations eq;
            ASSERT_TRUE(points.evaluate(pose, loss, eq));
            Matrix6 A = Matrix6::Zero();
            Vector6 g = Vector6::Zero();
            double cost = 0;
            for (std::size_t i = 0; i < n; ++i) {
                Eigen::Matrix2d C;
                C << covariances[i].uu, covariances[i].uv, covariances[i].uv, covariances[i].vv;
                const Eigen::Matrix2d L = C.inverse().llt().matrixL();
                const auto e = residual(camera, pose, body[i] - points.centroid_body_m(), pixels[i], L.transpose());
                const double s = e[0].a * e[0].a + e[1].a * e[1].a, w = loss.weight(s);
                // rho' is the slope of rho.
                EXPECT_NEAR(w, (loss.cost(s + 1e-6) - loss.cost(s - 1e-6)) / 2e-6, 1e-6);
                cost += loss.cost(s);
                for (const Jet6& x : e) A += w * x.v * x.v.transpose(), g -= w * x.v * x.a;
            }
            EXPECT_LT((eq.A - A).norm(), 1e-12 * A.norm());
            EXPECT_LT((eq.g - g).norm(), 1e-12 * std::sqrt(A.norm() * cost));
            EXPECT_NEAR(eq.chi2, cost, 1e-12 * cost);
        }
    }
}

}  // namespace
}  // namespace narpa
