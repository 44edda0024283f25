// Frames as a navigation program gets them: the real sinks write, the sources read.
#include "drivers/video/video_source.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

#include "drivers/video/video_sink.h"
#include "protocols/video/y4m.h"
#include "tests/drivers/video_support.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame;

constexpr VideoFormat kGreySource{64, 48, PixelFormat::grey, 100'000'000};
constexpr VideoFormat kBigSource{640, 480, PixelFormat::y16, 100'000'000};
constexpr std::int64_t kFramePatience_ns = 30'000'000'000;  // for what must come

std::string make_source_fifo(const test::TemporaryFolder& folder) {
    const std::string path = folder / "fifo";
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    return path;
}
std::unique_ptr<VideoSource> source_of(const std::string& spec, const VideoFormat& format) {
    auto source = open_video_source(spec, format);
    EXPECT_TRUE(source) << source.error().text();
    return source ? std::move(*source) : nullptr;
}
std::unique_ptr<VideoSink> sink_to(const std::string& spec, const VideoFormat& format) {
    auto sink = open_video_sink(spec, format, WhenFull::wait);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}
/// The next frame is number `number`.
void expect_frame(VideoSource& source, const VideoFormat& format, std::uint64_t number) {
    Bytes frame(frame_bytes(format));
    ASSERT_TRUE(source.receive(frame, kFramePatience_ns)) << number;
    ASSERT_TRUE(frame == noise_frame(format, number)) << "another frame than " << number;
}
bool nothing_comes(VideoSource& source, const VideoFormat& format) {
    Bytes frame(frame_bytes(format));
    return !source.receive(frame, 5'000'000);
}
void write_all(const std::string& path, std::string_view text) {
    const int fd = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT, 0600);
    EXPECT_EQ(::write(fd, text.data(), text.size()), static_cast<ssize_t>(text.size()));
    ::close(fd);
}

TEST(Y4mSource, FramesOfAFifoComeWholeInOrderInEveryFormat) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv}) {
        const test::TemporaryFolder folder;
        const std::string fifo = make_source_fifo(folder);
        const VideoFormat format{640, 480, pixel, 100'000'000};
        const auto source = source_of(fifo, format);  // before there is a writer: does not wait for one
        EXPECT_TRUE(nothing_comes(*source, format));
        const auto sink = sink_to(fifo, format);
        std::thread writer([&] {
            for (std::uint64_t i = 0; i < 25; ++i) sink->send(noise_frame(format, i));
        });
        for (std::uint64_t i = 0; i < 25; ++i) expect_frame(*source, format, i);
        writer.join();
        EXPECT_TRUE(nothing_comes(*source, format));
        EXPECT_EQ(source->counters().received, 25U);
        EXPECT_EQ(source->counters().truncated, 0U);
        EXPECT_TRUE(source->status());
    }
}

TEST(Y4mSource, TheNextWriterBeginsANewStream) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_source_fifo(folder);
    const auto source = source_of(fifo, kGreySource);
    const std::string header = *y4m_stream_header(kGreySource);
    write_all(fifo, header + "FRAME\n" + std::string(1000, 'x'));  // leaves in the middle of a frame
    EXPECT_TRUE(nothing_comes(*source, kGreySource));
    EXPECT_EQ(source->counters().truncated, 1U);
    for (std::uint64_t visit = 0; visit < 3; ++visit) {
        const auto sink = sink_to(fifo, kGreySource);
        for (std::uint64_t i = 0; i < 2; ++i) {
            sink->send(noise_frame(kGreySource, 10 * visit + i));
            expect_frame(*source, kGreySource, 10 * visit + i);
        }
    }
    write_all(fifo, header + "FRA");  // leaves in the middle of a line
    EXPECT_TRUE(nothing_comes(*source, kGreySource));
    EXPECT_EQ(source->counters().truncated, 2U);
    EXPECT_EQ(source->counters().received, 6U);
    EXPECT_TRUE(source->status());
}

TEST(Y4mSource, AFrameMayComeInPieces) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_source_fifo(folder);
    const auto source = source_of(fifo, kGreySource);
    const Bytes frame = noise_frame(kGreySource, 3);
    const std::string stream =
        *y4m_stream_header(kGreySource) + "FRAME Ip\n" + std::string(frame.begin(), frame.end()) + "FRAME\n";
    const int fd = ::open(fifo.c_str(), O_WRONLY);
    for (std::size_t at = 0; at < stream.size(); at += 37) {
        const std::string piece = stream.substr(at, 37);
        ASSERT_EQ(::write(fd, piece.data(), piece.size()), static_cast<ssize_t>(piece.size()));
        Bytes got(frame.size());
        if (at + 37 < stream.size() - 6) {
            EXPECT_FALSE(source->receive(got, 0)) << at;
        } else if (source->counters().received == 0) {
            EXPECT_TRUE(source->receive(got, 0));
            EXPECT_EQ(got, frame);
        }
    }
    ::close(fd);
    EXPECT_EQ(source->counters().received, 1U);
}

TEST(Y4mSource, AFileIsFollowedAsItGrows) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "out.y4m";
    const auto sink = sink_to(path, kBigSource);
    const auto source = source_of(path, kBigSource);
    EXPECT_TRUE(nothing_comes(*source, kBigSource));
    for (std::uint64_t i = 0; i < 6; ++i) {
        sink->send(noise_frame(kBigSource, i));
        expect_frame(*source, kBigSource, i);
    }
    const auto later = source_of(path, kBigSource);
    for (std::uint64_t i = 0; i < 6; ++i) expect_frame(*later, kBigSource, i);
    EXPECT_TRUE(nothing_comes(*later, kBigSource));
}

TEST(Y4mSource, AnotherFormatIsNamed) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_source_fifo(folder);
    const auto sink = sink_to(fifo, {64, 48, PixelFormat::y16, 1});
    const auto source = source_of(fifo, kGreySource);
    sink->send(noise_frame({64, 48, PixelFormat::y16, 1}, 0));
    Bytes frame(frame_bytes(kGreySource));
    EXPECT_FALSE(source->receive(frame, kFramePatience_ns));
    ASSERT_FALSE(source->status());
    EXPECT_EQ(source->status().error().text(),
              fifo + ": the stream has 64x48 Cmono16 frames, expected 64x48 Cmono");
    EXPECT_FALSE(source->receive(frame, kFramePatience_ns)) << "and it stays so";
}

TEST(Y4mSource, WhatIsNoVideoIsNamed) {
    const std::pair<std::string, const char*> cases[] = {
        {"P5 64 48 255\n", "not a Y4M stream: it does not begin with YUV4MPEG2"},
        {std::string(300, 'a'), "not a Y4M stream: a line of more than 256 bytes"},
        {"YUV4MPEG2 W64 H48 F10:1\n", "the stream has 64x48 C420 frames, expected 64x48 Cmono"},
        {"YUV4MPEG2 W640 Cmono\n", "the stream has 640x Cmono frames, expected 64x48 Cmono"},
        {*y4m_stream_header(kGreySource) + "FRAMES\n", "not a Y4M stream: FRAME expected, \"FRAMES\" found"},
    };
    for (const auto& [text, says] : cases) {
        const test::TemporaryFolder folder;
        write_all(folder / "bad.y4m", text);
        const auto source = source_of(folder / "bad.y4m", kGreySource);
        EXPECT_TRUE(nothing_comes(*source, kGreySource));
        ASSERT_FALSE(source->status()) << text;
        EXPECT_NE(source->status().error().text().find(says), std::string::npos) << source->status().error().text();
    }
}

TEST(Y4mSource, DamagedStreamsGiveAnErrorOrFramesAndNeverMore) {
    std::mt19937_64 random(71);
    const VideoFormat tiny{4, 2, PixelFormat::grey, 1};
    const test::TemporaryFolder folder;
    int failed = 0;
    for (int trial = 0; trial < 300; ++trial) {
        std::string stream = *y4m_stream_header(tiny);
        for (std::uint64_t i = 0; i < 3; ++i) stream += "FRAME\n" + std::string(8, 'x');
        for (std::uint64_t n = random() % 3; n > 0; --n)
            stream[random() % stream.size()] = static_cast<char>(random());
        if (random() % 4 == 0) stream.resize(random() % stream.size());
        const std::string path = folder / "" + std::to_string(trial) + ".y4m";
        write_all(path, stream);
        const auto source = source_of(path, tiny);
        Bytes frame(8);
        int got = 0;
        while (source->receive(frame, 0)) ++got;
        EXPECT_LE(got, 3);
        failed += source->status() ? 0 : 1;
    }
    EXPECT_GT(failed, 0);
    EXPECT_LT(failed, 300);
}

TEST(VideoSource, BadSourcesSayWhatIsWrong) {
    const test::TemporaryFolder folder;
    for (const char* name : {"frames.bin", "colour.y4m"}) write_all(folder / name, "x");
    const struct {
        std::string spec;
        VideoFormat format;
        ErrorKind kind;
        std::string says;
    } cases[] = {
        {"", kGreySource, ErrorKind::bad_input,
         "expected /dev/videoN, bridge:PORT, udp:PORT, rtp:PORT, FILE.y4m, or an existing FIFO"},
        {folder / "frames.bin", kGreySource, ErrorKind::bad_input, "expected /dev/videoN"},
        {folder / "fifo", kGreySource, ErrorKind::missing, "try: mkfifo " + (folder / "fifo")},
        {folder / "colour.y4m",
         {8, 8, PixelFormat::rgb24, 1},
         ErrorKind::bad_input,
         "it holds GREY, Y10, Y12, Y16 and YUYV"},
        {folder / "fifo", {0, 8, PixelFormat::grey, 1}, ErrorKind::bad_input, "must be positive"},
        {"/dev/video417", kGreySource, ErrorKind::missing,
         "sudo modprobe v4l2loopback video_nr=417 exclusive_caps=1 max_buffers=8"},
        {"/dev/null", kGreySource, ErrorKind::missing, "/dev/null: not a V4L2 device"},
    };
    for (const auto& c : cases) {
        const auto source = open_video_source(c.spec, c.format);
        ASSERT_FALSE(source) << c.spec;
        EXPECT_EQ(source.error().kind, c.kind) << c.spec;
        EXPECT_NE(source.error().text().find(c.says), std::string::npos) << source.error().text();
    }
}

/// On a real device: NARPA_TEST_V4L2=/dev/videoN, a v4l2loopback with exclusive_caps=1 max_buffers=8.
class V4l2Source : public testing::TestWithParam<PixelFormat> {
protected:
    void SetUp() override {
        const char* device = std::getenv("NARPA_TEST_V4L2");
        if (device == nullptr) GTEST_SKIP() << "set NARPA_TEST_V4L2=/dev/videoN to a v4l2loopback device";
        device_ = device;
        format_.pixel = GetParam();
    }
    std::string device_;
    VideoFormat format_{320, 240, PixelFormat::grey, 50'000'000};
};

TEST_P(V4l2Source, FramesComeInOrderFromTheFirstOn) {
    auto sink = sink_to(device_, format_);
    ASSERT_TRUE(sink);
    const auto source = source_of(device_, format_);  // before the first frame
    ASSERT_TRUE(source);
    for (std::uint64_t i = 0; i < 20; ++i) {
        EXPECT_TRUE(sink->send(noise_frame(format_, i)));
        expect_frame(*source, format_, i);
    }
    for (std::uint64_t i = 20; i < 22; ++i) EXPECT_TRUE(sink->send(noise_frame(format_, i)));
    for (std::uint64_t i = 20; i < 22; ++i) expect_frame(*source, format_, i);
    EXPECT_TRUE(nothing_comes(*source, format_));
    EXPECT_EQ(source->counters().received, 22U);
    EXPECT_EQ(source->counters().lost, 0U);
}

TEST_P(V4l2Source, FramesNotReadInTimeAreCounted) {
    auto sink = sink_to(device_, format_);
    ASSERT_TRUE(sink);
    const auto source = source_of(device_, format_);
    EXPECT_TRUE(sink->send(noise_frame(format_, 0)));
    expect_frame(*source, format_, 0);
    for (std::uint64_t i = 1; i < 10; ++i) EXPECT_TRUE(sink->send(noise_frame(format_, i)));
    sink->flush();
    Bytes frame(frame_bytes(format_));
    while (source->receive(frame, 5'000'000)) continue;
    EXPECT_EQ(frame, noise_frame(format_, 9)) << "the newest is there";
    EXPECT_EQ(source->counters().received + source->counters().lost, 10U);
}

TEST_P(V4l2Source, AnotherFormatIsNamed) {
    VideoFormat other = format_;
    other.width = 64;
    auto sink = sink_to(device_, format_);
    ASSERT_TRUE(sink);
    EXPECT_TRUE(sink->send(noise_frame(format_, 0)));
    sink->flush();
    const auto source = open_video_source(device_, other);
    std::string text;
    if (source) {  // the writer's format shows only with its first frame
        Bytes frame(frame_bytes(other));
        EXPECT_FALSE((*source)->receive(frame, kFramePatience_ns));
        ASSERT_FALSE((*source)->status());
        text = (*source)->status().error().text();
    } else {
        text = source.error().text();
    }
    EXPECT_NE(text.find("expected frames of 64x240"), std::string::npos) << text;
    EXPECT_NE(text.find("the device has 320x240"), std::string::npos) << text;
}

INSTANTIATE_TEST_SUITE_P(Formats, V4l2Source,
                         testing::Values(PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24,
                                         PixelFormat::rggb8, PixelFormat::bggr8, PixelFormat::gbrg16,
                                         PixelFormat::bggr16),
                         [](const auto& instance) { return std::string(name(instance.param)); });

}  // namespace
}  // namespace narpa
