// Datagrams of frames of 16 x 4 pixels, one after the other, each with a right CRC.
#include <algorithm>
#include <vector>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"
#include "protocols/video/frame_datagram.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    constexpr VideoFormat format{16, 4, PixelFormat::grey, 100'000'000};
    constexpr std::size_t kBytes = kFrameDatagramHeaderBytes + 16, kCrcAt = kFrameDatagramHeaderBytes - 4;
    FrameAssembly assembly(format);
    for (std::size_t at = 0; at < size; at += kBytes) {
        std::vector<std::uint8_t> datagram(data + at, data + std::min(at + kBytes, size));
        if (datagram.size() > kFrameDatagramHeaderBytes) {
            const auto bytes = std::span(datagram).subspan(kFrameDatagramHeaderBytes);
            put_le(&datagram[kCrcAt], crc32(bytes, crc32(std::span(datagram).first(kCrcAt))));
        }
        const auto header = decode_frame_datagram(datagram);
        if (fuzz::count(header.has_value())) {
            const auto bytes = std::span(datagram).subspan(kFrameDatagramHeaderBytes);
            fuzz::require(std::ranges::equal(encode_frame_datagram(*header, bytes),
                                             std::span(datagram).first(kFrameDatagramHeaderBytes)),
                          "a header has one form");
        }
        if (const FrameAssembly::Frame* frame = assembly.take(datagram))
            fuzz::require(frame->bytes.size() == frame_bytes(format), "a frame is whole");
    }
    const FrameAssembly::Counters& c = assembly.counters();
    fuzz::require(c.whole + c.incomplete + c.refused <= size / kBytes + 1, "each datagram counts once at most");
    return 0;
}
