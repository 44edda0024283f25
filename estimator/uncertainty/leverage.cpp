#include "estimator/uncertainty/leverage.h"

#include <cassert>
#include <cmath>
#include <cstddef>

namespace narpa {
namespace {

constexpr double kHeldAlone = 0.9;

struct Leverage {
    std::size_t row = 0;
    double value = 0;
};

/// Row with the largest leverage within the observed motions.
Leverage largest(const CheckedInformation& in, std::span<const WeightedRow> rows) {
    Matrix6 root = Matrix6::Zero();  // of the inverse
    for (int i = in.observability.unobserved; i < 6; ++i) {
        const Vector6 motion = in.observability.motions.col(i);
        root.row(i) = motion.transpose() / std::sqrt(motion.dot(in.hessian * motion));
    }
    Leverage most;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!rows[i].checked) continue;
        const double value = rows[i].weight * (root * rows[i].derivative).squaredNorm();
        if (value > most.value) most = {i, value};
    }
    return most;
}

}  // namespace

CheckedInformation checked_information(std::span<WeightedRow> rows, const PointSpread& spread, double threshold) {
    assert(std::isfinite(threshold) && threshold >= 0);
    CheckedInformation in;
    const auto add = [&](const WeightedRow& row, double sign) {
        const Matrix6 of_row = sign * row.derivative * row.derivative.transpose();
        in.hessian += row.weight * of_row;
        in.information += of_row;
    };
    const auto leave_out = [&](WeightedRow& row) {
        row.checked = false;
        ++in.unchecked;
        add(row, -1);
        in.observability = observability(in.hessian, spread, threshold);
    };
    for (const WeightedRow& row : rows)
        if (row.checked)
            add(row, 1);
        else
            ++in.unchecked;
    in.observability = observability(in.hessian, spread, threshold);
    for (;;) {
        const Leverage first = largest(in, rows);
        if (!(first.value > 0)) return in;
        CheckedInformation with_both = in;
        leave_out(rows[first.row]);
        if (first.value > kHeldAlone) continue;
        const Leverage second = largest(in, rows);
        if (!(second.value > kHeldAlone)) {
            rows[first.row].checked = true;
            return with_both;
        }
        leave_out(rows[second.row]);
    }
}

}  // namespace narpa
