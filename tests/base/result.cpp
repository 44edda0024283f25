#include "base/result.h"

#include <gtest/gtest.h>

#include <memory>

namespace narpa {
namespace {

TEST(Result, HoldsAValueOrAnError) {
    const Result<int> good = 7, bad = Error{.what = "no"};
    EXPECT_TRUE(good.has_value());
    EXPECT_EQ(*good, 7);
    EXPECT_FALSE(bad);
    EXPECT_EQ(bad.error().what, "no");
}

TEST(Result, MovesWhatCannotBeCopied) {
    Result<std::unique_ptr<int>> r = std::make_unique<int>(3);
    const std::unique_ptr<int> out = *std::move(r);
    EXPECT_EQ(*out, 3);
}

TEST(Result, StatusIsSuccessOrError) {
    const Status good = Ok{}, bad = Error{};
    EXPECT_TRUE(good);
    EXPECT_FALSE(bad);
}

TEST(Error, TextNamesThePlaceAsFarAsItIsKnown) {
    EXPECT_EQ((Error{.what = "w"}).text(), "w");
    EXPECT_EQ((Error{.what = "w", .file = "f"}).text(), "f: w");
    EXPECT_EQ((Error{.what = "w", .file = "f", .line = 3}).text(), "f:3: w");
    EXPECT_EQ((Error{.what = "w", .file = "f", .line = 3, .column = 9}).text(), "f:3:9: w");
    EXPECT_EQ((Error{.what = "w", .file = "f", .column = 9}).text(), "f: w") << "a column needs a line";
    EXPECT_EQ((Error{.what = "w", .remedy = "do this"}).text(), "w\n  try: do this");
}

TEST(Error, KindDecidesTheExitStatus) {
    EXPECT_EQ(exit_status(ErrorKind::failed), 1);
    EXPECT_EQ(exit_status(ErrorKind::bad_input), 2);
    EXPECT_EQ(exit_status(ErrorKind::missing), 3);
    EXPECT_EQ(Error{}.kind, ErrorKind::bad_input);
}

}  // namespace
}  // namespace narpa
