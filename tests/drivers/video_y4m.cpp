#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/video/video_sink.h"
#include "protocols/video/y4m.h"
#include "tests/drivers/video_support.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame, test::frames_of, test::stream_bytes;

constexpr VideoFormat kGrey{64, 48, PixelFormat::grey, 100'000'000};
constexpr VideoFormat kBig{640, 480, PixelFormat::grey, 100'000'000};  // more than a pipe holds

std::unique_ptr<VideoSink> opened(const std::string& spec, const VideoFormat& format, WhenFull full) {
    auto sink = open_video_sink(spec, format, full);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}

// A reader of a FIFO, in the test's own thread.
class Reader {
public:
    explicit Reader(const std::string& fifo) : fd_(::open(fifo.c_str(), O_RDONLY | O_NONBLOCK)) {}
    ~Reader() { leave(); }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;

    void leave() {
        if (fd_ >= 0) ::close(fd_);
        fd_ = -1;
    }
    // Reads until it has `count` bytes or half a minute is over.
    bool read(std::size_t count) {
        return test::eventually([&] {
            std::uint8_t part[65536];
            while (bytes.size() < count) {
                const ssize_t n = ::read(fd_, part, std::min(sizeof part, count - bytes.size()));
                if (n <= 0) return false;
                bytes.insert(bytes.end(), part, part + n);
            }
            return true;
        });
    }

    Bytes bytes;

private:
    int fd_;
};

std::string make_fifo(const test::TemporaryFolder& folder) {
    const std::string path = folder / "fifo";
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    return path;
}

TEST(Y4mSink, FfmpegReadsTheFileByteForByte) {
    if (!test::is_installed("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
    const test::TemporaryFolder folder;
    const struct {
        PixelFormat pixel;
        const char* ffmpeg;
    } cases[] = {{PixelFormat::grey, "gray"}, {PixelFormat::y16, "gray16le"}, {PixelFormat::yuyv, "yuyv422"}};
    for (const auto& c : cases) {
        const VideoFormat format{66, 34, c.pixel, 33'366'667};
        const std::string path = folder / "out.y4m";
        Bytes sent;
        {
            const auto sink = opened(path, format, WhenFull::wait);
            for (std::uint64_t i = 0; i < 20; ++i) {
                const Bytes frame = noise_frame(format, i);
                EXPECT_TRUE(sink->send(frame));
                sent.insert(sent.end(), frame.begin(), frame.end());
            }
            sink->flush();
            EXPECT_EQ(sink->counters().written, 20U);
        }
        const Bytes read = test::output_of("ffmpeg -v error -nostdin -i " + path +
                                           " -fps_mode passthrough -f rawvideo -pix_fmt " + c.ffmpeg + " -");
        EXPECT_TRUE(read == sent) << name(c.pixel) << ": " << read.size() << " bytes of " << sent.size();
        EXPECT_EQ(frames_of(test::read_bytes(path), format).size(), 20U);
    }
}

/// Right-justified pixels, as ffmpeg knows them too.
TEST(Y4mSink, FfmpegReadsPixelsOf10And12Bits) {
    if (!test::is_installed("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
    const test::TemporaryFolder folder;
    for (const std::uint8_t bits : {std::uint8_t{10}, std::uint8_t{12}}) {
        const VideoFormat format{66, 34, PixelFormat::y16, 33'366'667, {LinkLayout::Kind::right, bits}};
        const std::string path = folder / "out.y4m";
        Bytes sent = noise_frame(format, bits), expected(sent.size());
        for (std::size_t i = 0; i < sent.size(); i += 2) {
            const unsigned value = (sent[i] | sent[i + 1] << 8) >> (16 - bits);
            expected[i] = static_cast<std::uint8_t>(value), expected[i + 1] = static_cast<std::uint8_t>(value >> 8);
        }
        {
            const auto sink = opened(path, format, WhenFull::wait);
            EXPECT_TRUE(sink->send(sent));
        }
        const Bytes read = test::output_of("ffmpeg -v error -nostdin -i " + path + " -f rawvideo -pix_fmt gray" +
                                           std::to_string(bits) + "le -");
        EXPECT_TRUE(read == expected) << int{bits};
    }
}

TEST(Y4mSink, FfmpegReadsTheFifo) {
    if (!test::is_installed("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
    const test::TemporaryFolder folder;
    const std::string fifo = make_fifo(folder);
    Bytes read, sent;
    std::thread ffmpeg([&] {
        read = test::output_of("ffmpeg -v error -nostdin -f yuv4mpegpipe -i " + fifo +
                               " -fps_mode passthrough -f rawvideo -pix_fmt gray16le -");
    });
    {
        const VideoFormat format{320, 240, PixelFormat::y16, 100'000'000};
        const auto sink = opened(fifo, format, WhenFull::wait);
        for (std::uint64_t i = 0; i < 10; ++i) {
            const Bytes frame = noise_frame(format, i);
            EXPECT_TRUE(sink->send(frame));
            sent.insert(sent.end(), frame.begin(), frame.end());
        }
    }
    ffmpeg.join();
    EXPECT_TRUE(read == sent) << read.size() << " bytes of " << sent.size();
}

TEST(Y4mSink, FullDiskIsCounted) {
    if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
    const test::TemporaryFolder folder;
    const std::string path = folder / "full.y4m";
    ASSERT_EQ(::symlink("/dev/full", path.c_str()), 0);
    const auto sink = opened(path, kGrey, WhenFull::wait);
    for (std::uint64_t i = 0; i < 5; ++i) EXPECT_TRUE(sink->send(noise_frame(kGrey, i)));
    sink->flush();
    EXPECT_EQ(sink->counters().failed, 5U);
    EXPECT_EQ(sink->counters().written, 0U);
    ASSERT_FALSE(sink->failure());
    EXPECT_EQ(sink->failure().error().text(),
              "Y4M to " + path + ": 5 frames could not be written: No space left on device");
}

// A limit on the file's size stands for a disk that fills up and is cleaned up again.
TEST(Y4mSink, FileEndsWithAWholeFrameAndGoesOnWhenThereIsRoom) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "out.y4m";
    const auto sink = opened(path, kGrey, WhenFull::wait);
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    rlimit tight = before;
    tight.rlim_cur = stream_bytes(kGrey, 3) + 1000;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (std::uint64_t i = 0; i < 6; ++i) sink->send(noise_frame(kGrey, i));
    sink->flush();
    const std::vector<Bytes> at_limit = frames_of(test::read_bytes(path), kGrey);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_EQ(at_limit.size(), 3U);
    EXPECT_EQ(sink->counters().written, 3U);
    EXPECT_EQ(sink->counters().failed, 3U);
    sink->send(noise_frame(kGrey, 6));
    sink->flush();
    const std::vector<Bytes> frames = frames_of(test::read_bytes(path), kGrey);
    ASSERT_EQ(frames.size(), 4U);
    EXPECT_EQ(frames[2], noise_frame(kGrey, 2));
    EXPECT_EQ(frames[3], noise_frame(kGrey, 6));
}

TEST(Y4mSink, FifoWithoutReaderDropsAndCounts) {
    const test::TemporaryFolder folder;
    const auto sink = opened(make_fifo(folder), kGrey, WhenFull::drop);
    for (std::uint64_t i = 0; i < 5; ++i) EXPECT_TRUE(sink->send(noise_frame(kGrey, i)));
    sink->flush();
    EXPECT_EQ(sink->counters().no_reader, 5U);
    EXPECT_EQ(sink->counters().written, 0U);
}

TEST(Y4mSink, EveryReaderOfAFifoGetsAHeaderAndWholeFrames) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_fifo(folder);
    const auto sink = opened(fifo, kBig, WhenFull::drop);
    for (std::uint64_t visit = 0; visit < 4; ++visit) {
        Reader reader(fifo);
        sink->send(noise_frame(kBig, 10 * visit));
        ASSERT_TRUE(reader.read(stream_bytes(kBig, 1)));
        // Leaves in the middle of a frame, with the pipe full.
        sink->send(noise_frame(kBig, 10 * visit + 1));
        ASSERT_TRUE(reader.read(stream_bytes(kBig, 1) + 1000));
        reader.bytes.resize(stream_bytes(kBig, 1));
        const std::vector<Bytes> frames = frames_of(reader.bytes, kBig);
        ASSERT_EQ(frames.size(), 1U);
        EXPECT_TRUE(frames[0] == noise_frame(kBig, 10 * visit));
        reader.leave();
        ASSERT_TRUE(test::eventually([&] { return sink->counters().no_reader == visit + 1; }));
    }
    sink->flush();
    EXPECT_EQ(sink->counters().reconnects, 3U);
    EXPECT_EQ(sink->counters().written, 4U);
    EXPECT_EQ(sink->counters().failed, 0U);
}

// The reader leaves between two frames, with unread bytes in the pipe: they must not meet the next reader.
TEST(Y4mSink, WhatAReaderLeftUnreadIsGone) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_fifo(folder);
    const auto sink = opened(fifo, kGrey, WhenFull::drop);
    Reader first(fifo);
    for (std::uint64_t i = 0; i < 3; ++i) sink->send(noise_frame(kGrey, i));
    sink->flush();  // all three stand in the pipe
    EXPECT_EQ(sink->counters().written, 3U);
    ASSERT_TRUE(first.read(500));
    first.leave();
    // A FIFO with an open end keeps its bytes: when it is empty, the sink has closed its end too.
    ASSERT_TRUE(test::eventually([&] {
        pollfd fd{::open(fifo.c_str(), O_RDONLY | O_NONBLOCK), POLLIN, 0};
        const bool empty = ::poll(&fd, 1, 0) == 0 || !(fd.revents & POLLIN);
        ::close(fd.fd);
        return empty;
    }));
    Reader second(fifo);
    sink->send(noise_frame(kGrey, 9));
    ASSERT_TRUE(second.read(stream_bytes(kGrey, 1)));
    const std::vector<Bytes> frames = frames_of(second.bytes, kGrey);
    ASSERT_EQ(frames.size(), 1U);
    EXPECT_EQ(frames[0], noise_frame(kGrey, 9));
}

TEST(Y4mSink, StuckReaderCostsFramesButNeverTheEnd) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_fifo(folder);
    const Reader stuck(fifo);
    const auto sink = opened(fifo, kBig, WhenFull::drop);
    for (std::uint64_t i = 0; i < 30; ++i) sink->send(noise_frame(kBig, i));
    sink->flush();
    const VideoCounters c = sink->counters();
    EXPECT_GE(c.ring_full, 30U - 9U);
    EXPECT_GE(c.failed, 1U);
    EXPECT_EQ(c.ring_full + c.failed + c.no_reader + c.written, 30U);
}

TEST(Y4mSink, WaitingForASlowReaderLosesNothing) {
    const test::TemporaryFolder folder;
    const std::string fifo = make_fifo(folder);
    constexpr std::uint64_t count = 60;
    Bytes stream;
    std::thread reader([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // comes late
        const int fd = ::open(fifo.c_str(), O_RDONLY);
        std::uint8_t part[40'000];
        for (ssize_t n = 0; (n = ::read(fd, part, sizeof part)) > 0;) {
            stream.insert(stream.end(), part, part + n);
            std::this_thread::sleep_for(std::chrono::microseconds(200));
        }
        ::close(fd);
    });
    {
        const auto sink = opened(fifo, kBig, WhenFull::wait);
        for (std::uint64_t i = 0; i < count; ++i) EXPECT_TRUE(sink->send(noise_frame(kBig, i)));
    }
    reader.join();
    const std::vector<Bytes> frames = frames_of(stream, kBig);
    ASSERT_EQ(frames.size(), count);
    for (std::uint64_t i = 0; i < count; ++i) EXPECT_TRUE(frames[i] == noise_frame(kBig, i)) << i;
}

TEST(VideoSink, WrongSizedFrameIsRefused) {
    const test::TemporaryFolder folder;
    for (const std::string& spec : {folder / "out.y4m", std::string("none")}) {
        const auto sink = opened(spec, kGrey, WhenFull::drop);
        EXPECT_FALSE(sink->send(Bytes(10)));
        EXPECT_TRUE(sink->send(noise_frame(kGrey, 0)));
        sink->flush();
        EXPECT_EQ(sink->counters().failed, 1U) << spec;
        EXPECT_EQ(sink->counters().written, 1U) << spec;
        EXPECT_FALSE(sink->description().empty());
    }
}

TEST(VideoSink, BadSinksSayWhatIsWrong) {
    const test::TemporaryFolder folder;
    const struct {
        std::string spec;
        VideoFormat format;
        ErrorKind kind;
        std::string says;
    } cases[] = {
        {"nowhere", kGrey, ErrorKind::bad_input,
         "expected /dev/videoN, uvc:PORT, bulk:[BRIDGE], tcp:PORT, udp:HOST:PORT, rtp:HOST:PORT, gige:[ADDRESS], "
         "FILE.y4m, an existing FIFO, or none"},
        {"", kGrey, ErrorKind::bad_input, "expected /dev/videoN"},
        {folder / "out.y4m",
         {8, 8, PixelFormat::rgb24, 1},
         ErrorKind::bad_input,
         "it holds GREY, Y10, Y12, Y16 and YUYV"},
        {folder / "out.y4m", {8, 8, PixelFormat::bggr16, 1}, ErrorKind::bad_input, "cannot hold frames of BGGR16"},
        {folder / "no/such/folder.y4m", kGrey, ErrorKind::missing, "cannot write: No such file or directory"},
        {"rtp", kGrey, ErrorKind::bad_input, "expected /dev/videoN"},
        {"gige", kGrey, ErrorKind::bad_input, "expected /dev/videoN"},
        {"rtp:127.0.0.1:5004",
         {8, 8, PixelFormat::bggr8, 100'000'000},
         ErrorKind::bad_input,
         "rtp:127.0.0.1:5004: RFC 4175 has no mosaics such as BGGR8"},
        {"rtp:127.0.0.1:5004,sdp=" + (folder / "no/such/folder.sdp"), kGrey, ErrorKind::missing,
         "folder.sdp\": No such file or directory"},
        {"none", {0, 8, PixelFormat::grey, 1}, ErrorKind::bad_input, "must be positive"},
        {"none", {7, 8, PixelFormat::yuyv, 1}, ErrorKind::bad_input, "even width, not 7"},
        {"none", {8, 7, PixelFormat::rggb8, 1}, ErrorKind::bad_input, "RGGB8 needs an even height, not 7"},
        {"/dev/video417", kGrey, ErrorKind::missing,
         "sudo modprobe v4l2loopback video_nr=417 exclusive_caps=1 max_buffers=8"},
        {"/dev/null", kGrey, ErrorKind::missing, "/dev/null: not a V4L2 device (Inappropriate ioctl for device)"},
    };
    for (const auto& c : cases) {
        const auto sink = open_video_sink(c.spec, c.format, WhenFull::drop);
        ASSERT_FALSE(sink) << c.spec;
        EXPECT_EQ(sink.error().kind, c.kind) << c.spec;
        EXPECT_NE(sink.error().text().find(c.says), std::string::npos) << sink.error().text();
    }
}

}  // namespace
}  // namespace narpa
