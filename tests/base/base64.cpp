#include "base/text/base64.h"

#include <gtest/gtest.h>

namespace narpa {
namespace {

TEST(Base64, EncodesTheExamplesOfRfc4648) {
    EXPECT_EQ(base64(""), "");
    EXPECT_EQ(base64("f"), "Zg==");
    EXPECT_EQ(base64("fo"), "Zm8=");
    EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(Base64, DecodesWhatItEncodes) {
    std::string all;
    for (int i = 0; i < 256; ++i) all += static_cast<char>(i);
    for (std::size_t n = 0; n <= all.size(); ++n)
        EXPECT_EQ(from_base64(base64(all.substr(0, n))), all.substr(0, n));
    EXPECT_EQ(from_base64("Zm9v\nYmFy"), "foobar");
    EXPECT_EQ(from_base64("Zm8"), "fo") << "padding may be missing";
    EXPECT_FALSE(from_base64("Zm9*"));
}

}  // namespace
}  // namespace narpa
