// Information may rest only on measurements that others check.
#include "estimator/uncertainty/leverage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace narpa {
namespace {

constexpr double kThreshold = 1e-3;
const PointSpread kSpread{.weight = 1, .centre_m = {}, .radius_m = 1};

/// Six rows along the axes, `n` times, but the last axis only `n_last` times.
std::vector<WeightedRow> rows(int n, int n_last) {
    std::vector<WeightedRow> out;
    for (int axis = 0; axis < 6; ++axis)
        for (int i = 0; i < (axis == 5 ? n_last : n); ++i) out.push_back({Vector6::Unit(axis), 1, out.size()});
    return out;
}

TEST(Leverage, ManyRowsCheckEachOther) {
    auto all = rows(5, 5);
    const CheckedInformation in = checked_information(all, kSpread, kThreshold);
    EXPECT_EQ(in.unchecked, 0);
    EXPECT_EQ(in.observability.unobserved, 0);
    EXPECT_LT((in.information - 5 * Matrix6::Identity()).norm(), 1e-12);
}

TEST(Leverage, ThreeRowsThatHoldAMotionCheckEachOther) {
    auto all = rows(5, 3);
    EXPECT_EQ(checked_information(all, kSpread, kThreshold).unchecked, 0);
}

TEST(Leverage, OneOrTwoRowsThatHoldAMotionAreUnchecked) {
    for (const int n : {1, 2}) {
        auto all = rows(5, n);
        const CheckedInformation in = checked_information(all, kSpread, kThreshold);
        EXPECT_EQ(in.unchecked, n);
        EXPECT_EQ(in.observability.unobserved, 1);
        EXPECT_NEAR(std::abs(in.observability.motions(5, 0)), 1, 1e-12) << "the motion that is not observed";
        for (const WeightedRow& row : all) EXPECT_EQ(row.checked, row.derivative[5] == 0) << row.measurement;
    }
}

/// A row that others check in part: what they hold of its motion remains.
TEST(Leverage, InformationOfCheckedRowsRemains) {
    auto all = rows(5, 5);
    Vector6 strong = Vector6::Zero();
    strong[5] = 100;
    all.push_back({strong, 1, all.size()});
    const CheckedInformation in = checked_information(all, kSpread, kThreshold);
    EXPECT_EQ(in.unchecked, 1);
    EXPECT_FALSE(all.back().checked);
    EXPECT_LT((in.information - 5 * Matrix6::Identity()).norm(), 1e-9);
}

TEST(Leverage, RowsMarkedUncheckedAreLeftOut) {
    auto all = rows(5, 5);
    for (WeightedRow& row : all) row.checked = row.measurement % 5 != 0;
    const CheckedInformation in = checked_information(all, kSpread, kThreshold);
    EXPECT_EQ(in.unchecked, 6);
    EXPECT_LT((in.information - 4 * Matrix6::Identity()).norm(), 1e-12);
}

}  // namespace
}  // namespace narpa
