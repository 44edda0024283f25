/// tests/drivers/video_support.h - frames that are told apart, files of them, and ports for them.
#pragma once

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "base/pixel_format.h"
#include "drivers/descriptor.h"
#include "protocols/video/y4m.h"

namespace narpa::test {

using Bytes = std::vector<std::uint8_t>;

/// Frame number `seed` of a stream: noise, the same in every run.
inline Bytes noise_frame(const VideoFormat& format, std::uint64_t seed) {
    std::mt19937_64 random(seed * 4 + static_cast<std::uint64_t>(format.pixel));
    Bytes frame(frame_bytes(format));
    for (auto& byte : frame) byte = static_cast<std::uint8_t>(random());
    return frame;
}

/// A UDP socket at a port that nobody else has.
class OwnPort {
public:
    OwnPort() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        EXPECT_EQ(::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
        socklen_t size = sizeof at;
        ::getsockname(fd_.get(), reinterpret_cast<sockaddr*>(&at), &size);
        number_ = ntohs(at.sin_port);
    }
    [[nodiscard]] std::string text() const { return std::to_string(number_); }
    [[nodiscard]] int fd() const { return fd_.get(); }
    /// Leaves it to another socket.
    std::string release() {
        fd_.reset();
        return text();
    }

private:
    Descriptor fd_;
    std::uint16_t number_ = 0;
};

/// What a command writes to standard output; empty when it cannot run.
inline Bytes output_of(const std::string& command) {
    Bytes bytes;
    std::FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) return bytes;
    std::uint8_t part[65536];
    for (std::size_t n = 0; (n = std::fread(part, 1, sizeof part, pipe)) > 0;)
        bytes.insert(bytes.end(), part, part + n);
    ::pclose(pipe);
    return bytes;
}

inline bool is_installed(const char* program) {
    return !output_of(std::string("command -v ") + program).empty();
}

/// Waits for something that must happen soon; false after two minutes.
template <class Condition>
bool eventually(Condition condition) {
    for (int i = 0; i < 120'000; ++i) {
        if (condition()) return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
}

/// The frames of a stream; fails unless it is one header and whole frames.
inline std::vector<Bytes> frames_of(const Bytes& stream, const VideoFormat& format) {
    const std::string header = *y4m_stream_header(format) + std::string(kY4mFrameHeader);
    const std::size_t size = frame_bytes(format);
    const std::string text(stream.begin(), stream.end());
    std::vector<Bytes> frames;
    std::size_t at = header.size() - kY4mFrameHeader.size();
    if (!text.starts_with(header)) {
        ADD_FAILURE() << "no stream header, but: " << text.substr(0, 40);
        return frames;
    }
    for (; at < text.size(); at += kY4mFrameHeader.size() + size) {
        if (text.compare(at, kY4mFrameHeader.size(), kY4mFrameHeader) != 0 ||
            text.size() < at + kY4mFrameHeader.size() + size) {
            ADD_FAILURE() << "torn frame " << frames.size();
            return frames;
        }
        Bytes frame(size);
        frame_from_y4m(format, std::span(stream).subspan(at + kY4mFrameHeader.size(), size), frame);
        frames.push_back(std::move(frame));
    }
    return frames;
}

inline std::size_t stream_bytes(const VideoFormat& format, std::size_t frames) {
    return y4m_stream_header(format)->size() + frames * (kY4mFrameHeader.size() + frame_bytes(format));
}

}  // namespace narpa::test
