// The sink gige: without a client; tests/host/gige.py has Aravis's own.
#include <gtest/gtest.h>

#include "drivers/video/video_sink.h"
#include "tests/drivers/video_support.h"

namespace narpa {
namespace {

constexpr VideoFormat kGigeFrames{64, 48, PixelFormat::grey, 100'000'000};

bool lacks_aravis(const Result<std::unique_ptr<VideoSink>>& sink) {
    return !sink && sink.error().what.find("built without Aravis") != std::string::npos;
}

TEST(GigeSink, CountsFramesThatNobodyTakes) {
    auto sink = open_video_sink("gige:127.0.0.1", kGigeFrames, WhenFull::wait);
    if (lacks_aravis(sink)) GTEST_SKIP() << sink.error().text();
    if (!sink && sink.error().what.find("3956 is taken") != std::string::npos)
        GTEST_SKIP() << "another program has port 3956: " << sink.error().text();
    ASSERT_TRUE(sink) << sink.error().text();
    EXPECT_EQ((*sink)->description(), "GigE Vision camera narpa-0001 at 127.0.0.1");
    for (std::uint32_t k = 0; k < 3; ++k)
        EXPECT_TRUE((*sink)->send(test::noise_frame(kGigeFrames, k), {.t_ns = k, .number = k}));
    (*sink)->flush();
    EXPECT_EQ((*sink)->counters().no_reader, 3u);
    EXPECT_EQ((*sink)->counters().written + (*sink)->counters().failed, 0u);
    // The port is taken now.
    const auto second = open_video_sink("gige:127.0.0.1", kGigeFrames, WhenFull::wait);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().kind, ErrorKind::missing);
    EXPECT_NE(second.error().text().find("ss -lunp"), std::string::npos) << second.error().text();
}

TEST(GigeSink, BadOnesSayWhatIsWrong) {
    const struct {
        std::string text;
        VideoFormat format;
        ErrorKind kind;
        std::string says;
    } cases[] = {
        {"gige:192.0.2.1", kGigeFrames, ErrorKind::missing, "gige:192.0.2.1: Cannot assign requested address"},
        {"gige:lo", kGigeFrames, ErrorKind::bad_input, "gige:lo: expected gige:ADDRESS with an IPv4 address"},
        {"gige:127.0.0.1:3956", kGigeFrames, ErrorKind::bad_input, "expected gige:ADDRESS with an IPv4 address"},
        {"gige:",
         {64, 48, PixelFormat::y16, 100'000'000, {LinkLayout::Kind::mipi, 10}},
         ErrorKind::bad_input,
         "gige:: GigE Vision has no pixel format Y10P"},
    };
    for (const auto& c : cases) {
        const auto sink = open_video_sink(c.text, c.format, WhenFull::drop);
        if (lacks_aravis(sink)) GTEST_SKIP() << sink.error().text();
        ASSERT_FALSE(sink) << c.text;
        EXPECT_EQ(sink.error().kind, c.kind) << c.text;
        EXPECT_NE(sink.error().text().find(c.says), std::string::npos) << sink.error().text();
    }
}

}  // namespace
}  // namespace narpa
