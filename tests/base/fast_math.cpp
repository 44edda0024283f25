// Logarithms and powers that can be vectorised: as exact as their headers say.
#include "base/fast_math.h"

#include <gtest/gtest.h>

#include <cmath>

namespace narpa {
namespace {

TEST(FastMath, BinaryLogarithmsAreExactToAMillionth) {
    for (float x = 1e-37f; x < 1e37f; x *= 1.0037f) {
        const double exact = std::log2(static_cast<double>(x));
        EXPECT_NEAR(static_cast<double>(log2_of(x)), exact, std::max(1e-6, 2e-7 * std::abs(exact))) << x;
    }
    EXPECT_EQ(log2_of(1), 0);
    EXPECT_EQ(log2_of(0x1p100f), 100);
}

TEST(FastMath, PowersOfTwoAreExactToAMillionth) {
    for (float y = -16; y <= 16; y += 0.00137f)
        EXPECT_NEAR(static_cast<double>(exp2_of(y)) / std::exp2(static_cast<double>(y)), 1, 1e-6) << y;
    EXPECT_EQ(exp2_of(-125), 0x1p-125f);
    EXPECT_EQ(exp2_of(0), 1);
    EXPECT_EQ(exp2_of(125), 0x1p125f);
}

TEST(FastMath, PowersOfNumbersUpToOneAreExactToABillionth) {
    for (double x = 1; x > 1e-12; x *= 0.83)
        for (double n = 0.01; n < 1e5; n *= 3.7) {
            const double exact = std::pow(x, n);
            EXPECT_NEAR(unit_power(x, n), exact, 1e-9 * exact + 1e-300) << x << ' ' << n;
        }
}

}  // namespace
}  // namespace narpa
