// R(q), its derivatives, the image formation and one damped step against 60-digit numbers.
#include <gtest/gtest.h>

#include "estimator/least_squares/levenberg_marquardt.h"
#include "tests/estimator/pnp/crp.h"
#include "tests/support/oracle.h"

namespace narpa {
namespace {

using nlohmann::json;

Eigen::Vector3d vec(const json& j) {
    return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()};
}
std::vector<Vec3> points(const json& j) {
    std::vector<Vec3> p;
    for (const json& a : j) p.push_back(to_vec3(vec(a)));
    return p;
}
Eigen::VectorXd values(const json& j) {
    const auto v = j.get<std::vector<double>>();
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
}

TEST(Crp, MatrixAndDerivativesEqualTheOracle) {
    NEED_ORACLE(oracle, "crp_rotation");
    for (const json& c : oracle["cases"]) {
        SCOPED_TRACE(c["id"].dump() + " " + c["description"].get<std::string>());
        const Eigen::Vector3d q = vec(c["in"]["q"]);
        const Eigen::Matrix3d R = crp_matrix(q);
        const auto dR = crp_matrix_derivative(q);
        const Eigen::VectorXd expected_R = values(c["out"]["R"]), expected_dR = values(c["out"]["dR_dq"]);
        const double tolerance = 1e-14 * expected_dR.cwiseAbs().maxCoeff();
        for (int i = 0; i < 9; ++i) {
            EXPECT_NEAR(R(i / 3, i % 3), expected_R[i], 1e-15);
            for (int k = 0; k < 3; ++k) EXPECT_NEAR(dR(i, k), expected_dR[3 * i + k], tolerance);
        }
        // The oracle's quaternion is of the same axis and angle: it turns the other way.
        const Eigen::VectorXd wxyz = values(c["out"]["quat_wxyz"]);
        const Quat turned = conjugate(quaternion_from_crp(q));
        EXPECT_LE(angle_between(turned, {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}), 1e-15);
        const double angle = c["out"]["angle_rad"];
        EXPECT_NEAR(2 * std::atan2(std::hypot(turned.x, turned.y, turned.z), turned.w), angle, 1e-14 * angle);
        if (q.norm() < 1e6) {
            EXPECT_LT((crp_from_quaternion(quaternion_from_crp(q)) - q).norm(), 1e-15 * (1 + q.squaredNorm()));
        }
    }
}

TEST(Crp, ProjectionJacobianEqualsTheOracle) {
    NEED_ORACLE(oracle, "projection_jacobian");
    for (const json& c : oracle["cases"]) {
        SCOPED_TRACE(c["id"].dump() + " " + c["description"].get<std::string>());
        const Eigen::Vector3d q = vec(c["in"]["q"]), t = vec(c["in"]["t"]);
        const double f = c["in"]["f_px"];
        const std::vector<Vec3> a = points(c["in"]["points"]);
        const ProjectionVector h = projection_vector(q, t, f);
        const Eigen::VectorXd uv = image_points(h, a);
        const Eigen::MatrixXd J = image_points_derivative(h, a) * projection_vector_derivative(q, f);
        ASSERT_EQ(J.rows(), 2 * static_cast<Eigen::Index>(a.size()));
        for (std::size_t i = 0; i < a.size(); ++i) {
            const auto row = static_cast<Eigen::Index>(2 * i);
            const double tolerance = 1e-12 * f * (1 + norm(a[i]) / c["out"]["depth"][i].get<double>());
            EXPECT_NEAR(uv[row], c["out"]["u_px"][i].get<double>(), tolerance);
            EXPECT_NEAR(uv[row + 1], c["out"]["v_px"][i].get<double>(), tolerance);
            const Eigen::VectorXd expected = values(c["out"]["J"][i]);
            const double largest = expected.cwiseAbs().maxCoeff();
            for (int k = 0; k < 12; ++k) EXPECT_NEAR(J(row + k / 6, k % 6), expected[k], 1e-12 * largest) << i;
        }
    }
}

class LmOracle : public testing::Test {
protected:
    struct Case {
        std::vector<Vec3> points;
        Eigen::VectorXd measured;
        double f = 0;

        [[nodiscard]] NormalEquations equations(const Vector6& x) const {
            const ProjectionVector h = projection_vector(x.head<3>(), x.tail<3>(), f);
            const Eigen::MatrixXd J =
                image_points_derivative(h, points) * projection_vector_derivative(x.head<3>(), f);
            const Eigen::VectorXd e = measured - image_points(h, points);
            return {J.transpose() * J, J.transpose() * e, e.squaredNorm()};
        }
        bool evaluate(const Vector6& x, NormalEquations& eq) const {
            eq = equations(x);
            return true;
        }
        static Vector6 moved(const Vector6& x, const Vector6& step) { return x + step; }
    };
    static Case read(const json& c) {
        return {points(c["in"]["points"]), values(c["in"]["measured_uv"]), c["in"]["f_px"].get<double>()};
    }
    static Vector6 start(const json& c) {
        Vector6 x;
        x << vec(c["in"]["q0"]), vec(c["in"]["t0"]);
        return x;
    }
};

TEST_F(LmOracle, OneStepAndItsGain) {
    NEED_ORACLE(oracle, "lm_step");
    for (const json& c : oracle["cases"]) {
        SCOPED_TRACE(c["id"].dump() + " " + c["description"].get<std::string>());
        const Case problem = read(c);
        const json& out = c["out"];
        const NormalEquations eq = problem.equations(start(c));
        EXPECT_NEAR(eq.chi2, out["chi2"].get<double>(), 1e-9 * eq.chi2);
        const Eigen::VectorXd JtJ = values(out["JtJ"]), Jte = values(out["Jt_e"]);
        for (int i = 0; i < 36; ++i) EXPECT_NEAR(eq.A(i / 6, i % 6), JtJ[i], 1e-10 * JtJ.cwiseAbs().maxCoeff());
        EXPECT_LT((eq.g - Jte).norm(), 1e-9 * Jte.norm());
        for (const auto& [damping, name] :
             {std::pair{Damping::diagonal, "diag"}, std::pair{Damping::identity, "identity"}}) {
            const DampedStep step = damped_step(eq, c["in"]["lambda"], damping);
            ASSERT_TRUE(step.solved);
            const Eigen::VectorXd expected = values(out[std::string("step_") + name]);
            EXPECT_LT((step.h - expected).norm(), 1e-9 * expected.norm()) << name;
            const double predicted = out[std::string("predicted_reduction_") + name];
            EXPECT_NEAR(step.predicted_reduction, predicted, 1e-9 * predicted) << name;
            const double after = problem.equations(Case::moved(start(c), step.h)).chi2;
            EXPECT_NEAR((eq.chi2 - after) / step.predicted_reduction,
                        out[std::string("gain_") + name].get<double>(), 1e-6)
                << name;
        }
    }
}

TEST_F(LmOracle, ConvergesToTheMinimumWithItsDeviations) {
    NEED_ORACLE(oracle, "lm_step");
    for (const json& c : oracle["cases"]) {
        SCOPED_TRACE(c["id"].dump() + " " + c["description"].get<std::string>());
        Vector6 x = start(c);
        LmSummary summary;
        LmOptions options;
        options.step_sigma = 1e-7;
        levenberg_marquardt(read(c), x, options, summary);
        EXPECT_EQ(summary.status, LmStatus::converged);
        Eigen::VectorXd expected(6);
        expected << values(c["out"]["solution_q"]), values(c["out"]["solution_t"]);
        EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-9);
        Matrix6 covariance;
        ASSERT_TRUE(invert_information(read(c).equations(x).A, covariance));
        const Eigen::VectorXd deviations = values(c["out"]["crb_std_unit_noise"]);
        for (int i = 0; i < 6; ++i) EXPECT_NEAR(std::sqrt(covariance(i, i)), deviations[i], 1e-8 * deviations[i]);
    }
}

}  // namespace
}  // namespace narpa
