// Y4M to TCP clients: fast, slow and vanished ones, in real time and in lockstep.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <future>

#include "drivers/descriptor.h"
#include "drivers/video/video_sink.h"
#include "tests/drivers/video_support.h"

namespace narpa {
namespace {

using test::Bytes, test::noise_frame, test::frames_of, test::stream_bytes;

constexpr VideoFormat kSmall{64, 48, PixelFormat::grey, 100'000'000};
constexpr VideoFormat kLarge{1920, 1080, PixelFormat::grey, 100'000'000};  // more than two socket buffers hold

std::unique_ptr<VideoSink> opened(const VideoFormat& format, WhenFull full) {
    auto sink = open_video_sink("tcp:0", format, full);
    EXPECT_TRUE(sink) << sink.error().text();
    return sink ? std::move(*sink) : nullptr;
}

std::uint16_t port_of(const VideoSink& sink) {
    const std::string text = sink.description();
    return static_cast<std::uint16_t>(std::stoi(text.substr(text.find("127.0.0.1:") + 10)));
}

class TcpClient {
public:
    explicit TcpClient(const VideoSink& sink) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        const int room = 65536;
        const timeval patience{60, 0};
        ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
        ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(port_of(sink));
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
    }
    /// Appends to `bytes` until it has `count`; false: the stream ended before.
    bool read(std::size_t count) {
        std::array<std::uint8_t, 65536> part;
        while (bytes.size() < count) {
            const ssize_t n = ::recv(fd_.get(), part.data(), std::min(part.size(), count - bytes.size()), 0);
            if (n <= 0) return false;
            bytes.insert(bytes.end(), part.begin(), part.begin() + n);
        }
        return true;
    }
    void leave() { fd_.reset(); }
    [[nodiscard]] std::future<bool> read_later(std::size_t count) {
        return std::async(std::launch::async, [this, count] { return read(count); });
    }

    Bytes bytes{};

private:
    Descriptor fd_;
};

TEST(TcpSink, InLockstepEachClientGetsEachFrameFromItsFirstOn) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv}) {
        const VideoFormat format{1280, 960, pixel, 33'366'667};
        auto sink = opened(format, WhenFull::wait);
        ASSERT_TRUE(sink);
        TcpClient first(*sink), second(*sink);
        auto of_first = first.read_later(stream_bytes(format, 4)),
             of_second = second.read_later(stream_bytes(format, 4));
        for (std::uint64_t i = 0; i < 4; ++i) EXPECT_TRUE(sink->send(noise_frame(format, i)));
        ASSERT_TRUE(of_first.get() && of_second.get());
        of_first = first.read_later(stream_bytes(format, 12)),
        of_second = second.read_later(stream_bytes(format, 12));
        TcpClient late(*sink);
        auto of_late = late.read_later(stream_bytes(format, 8));
        for (std::uint64_t i = 4; i < 12; ++i) EXPECT_TRUE(sink->send(noise_frame(format, i)));
        EXPECT_TRUE(of_first.get() && of_second.get() && of_late.get());
        ASSERT_TRUE(test::eventually([&] { return sink->counters().written == 12; }));
        EXPECT_EQ(sink->counters().failed, 0U);
        EXPECT_EQ(sink->counters().reconnects, 2U);
        sink.reset();
        EXPECT_FALSE(first.read(first.bytes.size() + 1)) << "nothing follows the last frame";
        EXPECT_EQ(first.bytes, second.bytes);
        const auto frames = frames_of(first.bytes, format), of_the_late = frames_of(late.bytes, format);
        ASSERT_EQ(frames.size(), 12U);
        ASSERT_EQ(of_the_late.size(), 8U);
        for (std::uint64_t i = 0; i < 12; ++i) EXPECT_TRUE(frames[i] == noise_frame(format, i)) << i;
        for (std::uint64_t i = 0; i < 8; ++i) EXPECT_TRUE(of_the_late[i] == noise_frame(format, i + 4)) << i;
    }
}

TEST(TcpSink, InRealTimeASlowClientLosesWholeFramesAndDelaysNobody) {
    const auto sink = opened(kLarge, WhenFull::drop);
    ASSERT_TRUE(sink);
    TcpClient fast(*sink), slow(*sink);
    constexpr std::uint64_t kFrames = 12;
    std::vector<Bytes> sent;
    for (std::uint64_t i = 0; i < kFrames; ++i) {
        sent.push_back(noise_frame(kLarge, i));
        ASSERT_TRUE(sink->send(sent.back()));
        ASSERT_TRUE(fast.read(stream_bytes(kLarge, i + 1))) << "while the other one has read nothing";
    }
    // Frames 1 to 10: it still has what is left of frame 0; that it misses the last is known when the next one
    // comes.
    EXPECT_TRUE(test::eventually([&] { return sink->counters().failed >= kFrames - 2; }));
    // Both read until the slow one gets a new frame.
    auto rest_of_slow = slow.read_later(stream_bytes(kLarge, 2));
    while (rest_of_slow.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
        sent.push_back(noise_frame(kLarge, sent.size()));
        ASSERT_TRUE(sink->send(sent.back()));
        ASSERT_TRUE(fast.read(stream_bytes(kLarge, sent.size())));
    }
    ASSERT_TRUE(rest_of_slow.get());
    EXPECT_EQ(sink->counters().written, sent.size());
    EXPECT_EQ(sink->counters().ring_full, 0U);
    EXPECT_TRUE(frames_of(fast.bytes, kLarge) == sent);
    const auto frames = frames_of(slow.bytes, kLarge);
    ASSERT_EQ(frames.size(), 2U);
    EXPECT_TRUE(frames[0] == sent[0]);
    EXPECT_TRUE(std::ranges::find(sent.begin() + kFrames - 1, sent.end(), frames[1]) != sent.end())
        << "a whole frame, and a new one";
}

TEST(TcpSink, AClientThatLeavesAffectsNoOther) {
    for (const WhenFull full : {WhenFull::wait, WhenFull::drop}) {
        const auto sink = opened(kLarge, full);
        ASSERT_TRUE(sink);
        TcpClient stays(*sink), leaves(*sink);
        auto of_stays = stays.read_later(stream_bytes(kLarge, 1));
        ASSERT_TRUE(sink->send(noise_frame(kLarge, 0)));
        ASSERT_TRUE(leaves.read(stream_bytes(kLarge, 1) / 2));
        leaves.leave();
        ASSERT_TRUE(of_stays.get());
        of_stays = stays.read_later(stream_bytes(kLarge, 2));
        ASSERT_TRUE(sink->send(noise_frame(kLarge, 1)));
        ASSERT_TRUE(of_stays.get());
        TcpClient comes(*sink);
        auto of_comes = comes.read_later(stream_bytes(kLarge, 1));
        of_stays = stays.read_later(stream_bytes(kLarge, 3));
        ASSERT_TRUE(sink->send(noise_frame(kLarge, 2)));
        ASSERT_TRUE(of_comes.get() && of_stays.get());
        EXPECT_EQ(frames_of(stays.bytes, kLarge).size(), 3U);
        EXPECT_TRUE(frames_of(comes.bytes, kLarge) == std::vector<Bytes>{noise_frame(kLarge, 2)});
        stays.leave();
        comes.leave();
        ASSERT_TRUE(sink->send(noise_frame(kLarge, 3)));
        EXPECT_TRUE(test::eventually([&] { return sink->counters().no_reader == 1; }));
    }
}

/// A machine that has lost power neither reads nor closes. This takes the ten seconds of the sink's patience.
TEST(TcpSink, LockstepGoesOnWithoutAClientThatTakesNothing) {
    const auto sink = opened(kLarge, WhenFull::wait);
    ASSERT_TRUE(sink);
    const TcpClient silent(*sink);
    for (std::uint64_t i = 0; i < 12; ++i)
        ASSERT_TRUE(sink->send(noise_frame(kLarge, i)));  // more than the ring holds
    EXPECT_TRUE(test::eventually([&] { return sink->counters().no_reader == 12; }));
    EXPECT_EQ(sink->counters().failed, 1U);
    EXPECT_EQ(sink->counters().written, 0U);
}

TEST(TcpSink, WithoutClientsFramesAreCountedInBothModes) {
    for (const WhenFull full : {WhenFull::wait, WhenFull::drop}) {
        const auto sink = opened(kSmall, full);
        ASSERT_TRUE(sink);
        for (std::uint64_t i = 0; i < 3; ++i) ASSERT_TRUE(sink->send(noise_frame(kSmall, i)));
        sink->flush();
        EXPECT_EQ(sink->counters().no_reader, 3U);
    }
}

TEST(TcpSink, BadOnesSayWhatIsWrong) {
    for (const char* bad : {"tcp:", "tcp:x", "tcp:70000", "tcp:host:5000", "tcp:1.2.3.4:"}) {
        const auto sink = open_video_sink(bad, kSmall, WhenFull::drop);
        ASSERT_FALSE(sink) << bad;
        EXPECT_EQ(sink.error().kind, ErrorKind::bad_input) << bad;
        EXPECT_NE(sink.error().what.find("expected tcp:[ADDRESS:]PORT"), std::string::npos) << sink.error().what;
    }
    const auto first = opened(kSmall, WhenFull::drop);
    const auto taken = open_video_sink("tcp:" + std::to_string(port_of(*first)), kSmall, WhenFull::drop);
    ASSERT_FALSE(taken);
    EXPECT_EQ(taken.error().kind, ErrorKind::missing);
    EXPECT_NE(taken.error().what.find("Address already in use"), std::string::npos) << taken.error().what;
    const auto colour = open_video_sink("tcp:0", {8, 8, PixelFormat::rgb24, 1}, WhenFull::drop);
    ASSERT_FALSE(colour);
    EXPECT_NE(colour.error().what.find("it holds GREY, Y10, Y12, Y16 and YUYV"), std::string::npos)
        << colour.error().what;
}

}  // namespace
}  // namespace narpa
