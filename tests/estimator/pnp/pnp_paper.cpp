// The paper's solver over a global vector of Rodrigues parameters: as corrected, and as printed.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "estimator/least_squares/levenberg_marquardt.h"
#include "tests/estimator/pnp/crp.h"
#include "tests/estimator/pnp/pnp_support.h"

namespace narpa {
namespace {

/// What the paper has in print, against what follows from its own definitions.
struct Misprints {
    bool r33 = false, jf_row = false, jg_sign = false;
};

/// State: (q, t), added to.
struct GlobalCrp {
    const std::vector<Vec3>& points;
    Eigen::VectorXd measured;
    double f = 0;
    Misprints printed{};

    bool evaluate(const Vector6& x, NormalEquations& eq) const {
        const Eigen::Vector3d q = x.head<3>();
        ProjectionVector h = projection_vector(q, x.tail<3>(), f);
        auto Jg = projection_vector_derivative(q, f);
        if (printed.r33) h[10] = (1 + q[0] * q[0] - q[1] * q[1] - q[2] * q[2]) / (1 + q.squaredNorm());
        if (printed.jg_sign) Jg(8, 2) = -Jg(8, 2);
        Eigen::Matrix<double, Eigen::Dynamic, 12> Jf = image_points_derivative(h, points);
        if (printed.jf_row)
            for (Eigen::Index row = 0; row < Jf.rows(); row += 2)
                Jf.block<1, 4>(row + 1, 8) = Eigen::RowVector4d(Jf.block<1, 4>(row, 8));
        const Eigen::MatrixXd J = Jf * Jg;
        const Eigen::VectorXd e = measured - image_points(h, points);
        eq = {J.transpose() * J, J.transpose() * e, e.squaredNorm()};
        return std::isfinite(eq.chi2);
    }
    static Vector6 moved(const Vector6& x, const Vector6& step) { return x + step; }
};

struct Outcome {
    int solved = 0;
    double mean_steps = 0;
};

/// Twelve points, 0.1 px, about 15 m away; solved where the attitude is within 1 degree.
Outcome solve(double angle_deg, double off_deg, double off_part, const Misprints& printed, const LmOptions& options,
              int trials) {
    std::mt19937_64 random(3);
    Outcome outcome;
    for (int trial = 0; trial < trials; ++trial) {
        const double angle = angle_deg >= 0 ? angle_deg : std::uniform_real_distribution<double>(0, 120)(random);
        const Rigid3 truth{exp_rotation(test::random_direction(random) * (angle * kRadPerDeg)), {0.3, -0.2, 15}};
        const test::Seen seen = test::see(random, test::random_points(random, 12, 2.5), truth, 0.1);
        GlobalCrp problem{seen.body_m, Eigen::VectorXd(24), seen.camera.fx, printed};
        for (std::size_t i = 0; i < 12; ++i) {
            problem.measured[static_cast<Eigen::Index>(2 * i)] = seen.pixels[i].u - seen.camera.cx;
            problem.measured[static_cast<Eigen::Index>(2 * i + 1)] = seen.pixels[i].v - seen.camera.cy;
        }
        const Rigid3 start = test::pose_off_by(random, truth, off_deg * kRadPerDeg, off_part);
        Vector6 x;
        x << crp_from_quaternion(start.q), to_eigen(start.t);
        LmSummary summary;
        levenberg_marquardt(problem, x, options, summary);
        const double error = angle_between(quaternion_from_crp(x.head<3>()), truth.q);
        outcome.solved += error < 1 * kRadPerDeg ? 1 : 0;
        outcome.mean_steps += static_cast<double>(summary.iterations) / trials;
    }
    return outcome;
}

TEST(PaperSolver, CorrectedSolvesAllWhereThePrintedOneFails) {
    constexpr int kTrials = 300;
    LmOptions options;
    options.iterations_max = 150;
    options.chi2_settled = 0;  // the paper's rules alone
    const Outcome corrected = solve(-1, 10, 0.05, {}, options, kTrials);
    EXPECT_EQ(corrected.solved, kTrials);
    EXPECT_LE(corrected.mean_steps, 8);

    LmOptions as_printed = options;
    as_printed.damping = Damping::identity;
    as_printed.up = 0.1;  // a rejected step divides the damping
    as_printed.down = 10;
    const Outcome printed = solve(-1, 10, 0.05, {true, true, true}, as_printed, kTrials);
    EXPECT_LT(printed.solved, 0.85 * kTrials);
    EXPECT_GT(printed.mean_steps, 10 * corrected.mean_steps);

    // One misprint at a time.
    EXPECT_LT(solve(-1, 10, 0.05, {.r33 = true}, options, kTrials).solved, 0.85 * kTrials);
    EXPECT_GT(solve(-1, 10, 0.05, {.jf_row = true}, options, kTrials).mean_steps, 3 * corrected.mean_steps);
    EXPECT_GT(solve(-1, 10, 0.05, {.jg_sign = true}, options, kTrials).mean_steps, 1.7 * corrected.mean_steps);
    as_printed.damping = Damping::diagonal;
    EXPECT_EQ(solve(-1, 60, 0.05, {}, options, kTrials).solved, kTrials);
    EXPECT_LT(solve(-1, 60, 0.05, {}, as_printed, kTrials).solved, 0.9 * kTrials);
}

TEST(PaperSolver, GlobalParametersFailNearHalfATurn) {
    constexpr int kTrials = 200;
    LmOptions options;
    options.iterations_max = 200;
    options.chi2_settled = 0;
    EXPECT_EQ(solve(120, 3, 0.02, {}, options, kTrials).solved, kTrials);
    const Outcome near = solve(179, 3, 0.02, {}, options, kTrials);
    EXPECT_LT(near.solved, 0.9 * kTrials);
    EXPECT_GT(near.mean_steps, 20);
}

}  // namespace
}  // namespace narpa
