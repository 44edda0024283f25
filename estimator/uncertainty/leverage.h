/// estimator/uncertainty/leverage.h - finds measurements that are not checked by others.
///
/// The leverage of a measurement is the part of the information along its own direction that it holds itself: w j'
/// H^-1 j, with j its derivative, w its weight and H the Hessian of all. At one it has no residual, whatever its
/// error; at 1 - r its error shows in its residual by the part r, its redundancy (W. Baarda, "A testing procedure
/// for use in geodetic networks", 1968; D. Hoaglin, R. Welsch, "The hat matrix in regression and ANOVA", 1978).
#pragma once

#include <cstddef>
#include <span>

#include "estimator/uncertainty/observability.h"

namespace narpa {

struct WeightedRow {
    Vector6 derivative = Vector6::Zero();  ///< of the residual with the pose, in standard deviations
    double weight = 1;
    std::size_t measurement = 0;  ///< its number
    bool checked = true;
};

/// Information of the rows that are checked by others.
struct CheckedInformation {
    Matrix6 hessian = Matrix6::Zero(), information = Matrix6::Zero();  ///< sums with and without the weights
    Observability observability{};
    int unchecked = 0;  ///< rows left out
};

/// Leaves out the rows that are not checked. Also marks as not checked and leaves out rows that determine a motion
/// alone, or in pairs: leverages above 0.9, for the second of a pair once the first is left out. `threshold`: of
/// observability().
[[nodiscard]] CheckedInformation checked_information(std::span<WeightedRow> rows, const PointSpread& spread,
                                                     double threshold);

}  // namespace narpa
