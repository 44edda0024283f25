// Packets of frames of 8 x 2 pixels, one after the other; a byte before each says how many bytes it has.
#include <algorithm>
#include <vector>

#include "protocols/video/rtp_video.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    constexpr VideoFormat kFormats[]{{8, 2, PixelFormat::grey, 100'000'000},
                                     {8, 2, PixelFormat::y16, 100'000'000, {LinkLayout::Kind::right, 10}},
                                     {8, 2, PixelFormat::rgb24, 100'000'000}};
    if (size == 0) return 0;
    const VideoFormat& format = kFormats[data[0] % std::size(kFormats)];
    RtpVideoAssembly assembly(format, *rtp_sampling(format));
    std::uint64_t packets = 0;
    for (std::size_t at = 1; at < size; ++packets) {
        const std::size_t bytes = std::min<std::size_t>(data[at], size - at - 1);
        // In memory of its own, so that a read past its end is found.
        const std::vector<std::uint8_t> packet(data + at + 1, data + at + 1 + bytes);
        at += 1 + bytes;
        const RtpVideoAssembly::Counters before = assembly.counters();
        const RtpVideoAssembly::Frame* frame = assembly.take(packet);
        const RtpVideoAssembly::Counters& c = assembly.counters();
        fuzz::count(c.refused + c.unfit == before.refused + before.unfit);
        fuzz::require((frame != nullptr) == (c.whole == before.whole + 1), "a frame that comes out is counted");
        if (frame != nullptr) fuzz::require(frame->bytes.size() == frame_bytes(format), "a frame is whole");
    }
    const RtpVideoAssembly::Counters& c = assembly.counters();
    fuzz::require(c.whole + c.incomplete <= packets && c.refused + c.unfit <= packets, "a packet counts once");
    return 0;
}
