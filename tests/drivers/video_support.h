/// tests/drivers/video_support.h - frames that are told apart, and files of them.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "base/pixel_format.h"

namespace narpa::test {

using Bytes = std::vector<std::uint8_t>;

/// Frame number `seed` of a stream: noise, the same in every run.
inline Bytes noise_frame(const VideoFormat& format, std::uint64_t seed) {
    std::mt19937_64 random(seed * 4 + static_cast<std::uint64_t>(format.pixel));
    Bytes frame(frame_bytes(format));
    for (auto& byte : frame) byte = static_cast<std::uint8_t>(random());
    return frame;
}

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

}  // namespace narpa::test
