#include "base/text/nearest_name.h"

#include <gtest/gtest.h>

namespace narpa {
namespace {

const std::vector<std::string> kKnown{"body", "camera", "sun", "scene"};

TEST(NearestName, IsAtMostTwoChangesAway) {
    EXPECT_EQ(nearest_name("camrea", kKnown), "camera");
    EXPECT_EQ(nearest_name("snu", kKnown), "sun");
    EXPECT_EQ(nearest_name("cameras", kKnown), "camera");
    EXPECT_FALSE(nearest_name("atmosphere", kKnown));
    EXPECT_FALSE(nearest_name("", kKnown));
    EXPECT_FALSE(nearest_name("sun", {}));
}

TEST(NearestName, OfAPluralIsItsSingular) {
    EXPECT_EQ(nearest_name("bodies", kKnown), "body");
}

TEST(NearestName, MayLackItsEndOrHaveTooMuchOfIt) {
    EXPECT_EQ(nearest_name("fov_horizontal", {"format", "fov_horizontal_deg"}), "fov_horizontal_deg");
    EXPECT_EQ(nearest_name("radius_metres", {"mesh", "radius"}), "radius");
    EXPECT_FALSE(nearest_name("up_is", {"up"}));
}

TEST(NearestName, DidYouMeanIsEmptyWithoutOne) {
    EXPECT_EQ(did_you_mean("bodies", kKnown), "; did you mean \"body\"?");
    EXPECT_EQ(did_you_mean("atmosphere", kKnown), "");
}

}  // namespace
}  // namespace narpa
