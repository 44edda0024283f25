// Runs on a real device: NARPA_TEST_V4L2=/dev/videoN, a v4l2loopback with exclusive_caps=1 max_buffers=8.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>

#include "drivers/video/v4l2_device.h"
#include "drivers/video/video_sink.h"
#include "tests/drivers/video_support.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame;

TEST(V4l2Format, CodesAreThoseOfTheKernel) {
    // linux/videodev2.h; Documentation/userspace-api/media/v4l/pixfmt-bayer.rst
    const std::pair<PixelFormat, std::string> cases[] = {
        {PixelFormat::grey, "GREY"},   {PixelFormat::y16, "Y16 "},    {PixelFormat::yuyv, "YUYV"},
        {PixelFormat::rgb24, "RGB3"},  {PixelFormat::rggb8, "RGGB"},  {PixelFormat::grbg8, "GRBG"},
        {PixelFormat::gbrg8, "GBRG"},  {PixelFormat::bggr8, "BA81"},  {PixelFormat::rggb16, "RG16"},
        {PixelFormat::grbg16, "GR16"}, {PixelFormat::gbrg16, "GB16"}, {PixelFormat::bggr16, "BYR2"}};
    for (const auto& [pixel, code] : cases) {
        const int line = 64 * static_cast<int>(bytes_per_pixel(pixel));
        EXPECT_EQ(format_text(v4l2_wanted_format({64, 48, pixel})),
                  "64x48 " + code + ", " + std::to_string(line) + " bytes a line");
    }
}

TEST(V4l2Format, MosaicsOf16BitsMayTravelAsY16) {
    const auto carrier = [](PixelFormat pixel) { return format_text(v4l2_carrier_format({64, 48, pixel})); };
    EXPECT_EQ(carrier(PixelFormat::gbrg16), "64x48 Y16 , 128 bytes a line");
    EXPECT_EQ(carrier(PixelFormat::gbrg8), "64x48 GBRG, 64 bytes a line");
    EXPECT_EQ(carrier(PixelFormat::yuyv), "64x48 YUYV, 128 bytes a line");
}

constexpr int kReaderFrames = 6;

class V4l2Sink : public testing::TestWithParam<PixelFormat> {
protected:
    void SetUp() override {
        const char* device = std::getenv("NARPA_TEST_V4L2");
        if (device == nullptr) GTEST_SKIP() << "set NARPA_TEST_V4L2=/dev/videoN to a v4l2loopback device";
        if (!test::is_installed("v4l2-ctl")) GTEST_SKIP() << "v4l2-ctl is not installed (v4l-utils)";
        device_ = device;
        format_.pixel = GetParam();
    }

    // Streams to one reader while it lives; what it read must be sent frames, whole and in order.
    void serve_one_reader(VideoSink& sink) {
        const std::string file = folder_ / "read";
        std::atomic<bool> done{false};
        std::thread reader([&] {
            test::output_of("v4l2-ctl -d " + device_ + " --stream-mmap=4 --stream-count=" +
                            std::to_string(kReaderFrames) + " --stream-to=" + file + " 2>&1");
            done = true;
        });
        while (!done) {
            EXPECT_TRUE(sink.send(noise_frame(format_, sent_++)));
            sink.flush();
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
        reader.join();
        const Bytes read = test::read_bytes(file);
        const std::size_t size = frame_bytes(format_);
        ASSERT_EQ(read.size(), kReaderFrames * size);
        std::uint64_t candidate = 0;
        for (std::size_t k = 0; k < kReaderFrames; ++k) {
            const Bytes frame(read.begin() + static_cast<long>(k * size),
                              read.begin() + static_cast<long>((k + 1) * size));
            while (candidate < sent_ && noise_frame(format_, candidate) != frame) ++candidate;
            ASSERT_LT(candidate++, sent_) << "frame " << k << " was never sent, or came out of order";
        }
    }

    std::string device_;
    VideoFormat format_{320, 240, PixelFormat::grey, 50'000'000};
    std::uint64_t sent_ = 0;
    test::TemporaryFolder folder_;
};

TEST_P(V4l2Sink, ReadersGetTheFramesByteForByte) {
    auto sink = open_video_sink(device_, format_, WhenFull::wait);
    ASSERT_TRUE(sink) << sink.error().text();
    serve_one_reader(**sink);
    serve_one_reader(**sink);  // the reader has left; another comes
    EXPECT_EQ((*sink)->counters().written, sent_);
    EXPECT_EQ((*sink)->counters().failed, 0U);
}

TEST_P(V4l2Sink, DeviceIsFreeAgainAfterTheSink) {
    for (int i = 0; i < 3; ++i) {
        auto sink = open_video_sink(device_, format_, WhenFull::wait);
        ASSERT_TRUE(sink) << sink.error().text();
        EXPECT_TRUE((*sink)->send(noise_frame(format_, 1)));
    }
}

TEST_P(V4l2Sink, SecondWriterIsRefused) {
    auto first = open_video_sink(device_, format_, WhenFull::wait);
    ASSERT_TRUE(first) << first.error().text();
    EXPECT_TRUE((*first)->send(noise_frame(format_, 1)));
    (*first)->flush();
    VideoFormat other = format_;
    other.width = 64;
    const auto second = open_video_sink(device_, other, WhenFull::wait);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().kind, ErrorKind::missing);
    EXPECT_NE(second.error().text().find("modprobe"), std::string::npos) << second.error().text();
}

INSTANTIATE_TEST_SUITE_P(Formats, V4l2Sink,
                         testing::Values(PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24,
                                         PixelFormat::rggb8, PixelFormat::bggr8, PixelFormat::gbrg16,
                                         PixelFormat::bggr16),
                         [](const auto& instance) { return std::string(name(instance.param)); });

}  // namespace
}  // namespace narpa
