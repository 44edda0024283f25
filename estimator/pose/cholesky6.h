/// estimator/pose/cholesky6.h - LDL' of symmetric positive definite 6 x 6 systems, unrolled.
#pragma once

#include <algorithm>

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// M = L D L' with L of unit diagonal; of M the lower triangle is read.
class Cholesky6 {
public:
    explicit Cholesky6(const Matrix6& M) {
        double scaled[kSize][kSize];  // L D
#pragma GCC unroll 6
        for (int j = 0; j < kSize; ++j) {
            double d = M(j, j);
#pragma GCC unroll 6
            for (int k = 0; k < j; ++k) d -= scaled[j][k] * L_[j][k];
            positive_ = positive_ && d > 0;
            // The remaining part of a diagonal entry does not depend on the row's unit.
            smallest_ = std::min(smallest_, d / M(j, j));
            inverse_d_[j] = 1 / d;
#pragma GCC unroll 6
            for (int i = j + 1; i < kSize; ++i) {
                double l = M(i, j);
#pragma GCC unroll 6
                for (int k = 0; k < j; ++k) l -= scaled[i][k] * L_[j][k];
                scaled[i][j] = l;
                L_[i][j] = l * inverse_d_[j];
            }
        }
    }

    [[nodiscard]] bool positive_definite() const noexcept {
        return positive_;
    }
    /// The smallest pivot as a part of its diagonal entry, in (0, 1]: near rounding where rank is missing.
    [[nodiscard]] double smallest_pivot() const noexcept {
        return smallest_;
    }

    [[nodiscard]] Vector6 solve(const Vector6& b) const {
        double x[kSize];
#pragma GCC unroll 6
        for (int i = 0; i < kSize; ++i) {
            x[i] = b[i];
#pragma GCC unroll 6
            for (int k = 0; k < i; ++k) x[i] -= L_[i][k] * x[k];
        }
        Vector6 out;
#pragma GCC unroll 6
        for (int i = kSize - 1; i >= 0; --i) {
            x[i] *= inverse_d_[i];
#pragma GCC unroll 6
            for (int k = i + 1; k < kSize; ++k) x[i] -= L_[k][i] * x[k];
            out[i] = x[i];
        }
        return out;
    }

    [[nodiscard]] Matrix6 inverse() const {
        Matrix6 out;
        for (int j = 0; j < kSize; ++j) out.col(j) = solve(Vector6::Unit(j));
        return 0.5 * (out + out.transpose());
    }

private:
    static constexpr int kSize = 6;
    double L_[kSize][kSize];
    double inverse_d_[kSize];
    double smallest_ = 1;
    bool positive_ = true;
};

}  // namespace narpa
