#include "estimator/search/attitude_grid.h"

#include <cmath>
#include <numbers>

namespace narpa {

std::vector<Quat> attitude_grid(int count) {
    // Constants of the paper: psi is the positive root of psi^4 = psi + 4.
    constexpr double kPhi = std::numbers::sqrt2, kPsi = 1.533751168755204288118041;
    std::vector<Quat> grid;
    for (int i = 0; i < count; ++i) {
        const double s = i + 0.5, t = s / count, turn = 2 * std::numbers::pi * s;
        const double alpha = turn / kPhi, beta = turn / kPsi, r = std::sqrt(t), rest = std::sqrt(1 - t);
        grid.push_back({rest * std::cos(beta), r * std::sin(alpha), r * std::cos(alpha), rest * std::sin(beta)});
    }
    return grid;
}

}  // namespace narpa
