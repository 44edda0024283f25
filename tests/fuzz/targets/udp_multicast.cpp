// A datagram of python-can's udp_multicast bus.
#include "protocols/can/udp_multicast.h"

#include <array>

#include "tests/fuzz/can_frames.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    CanFrame frame;
    if (!fuzz::count(decode_udp_multicast({data, size}, frame))) return 0;
    fuzz::require(fuzz::is_valid(frame), "a frame is valid");
    std::array<std::uint8_t, kUdpMulticastMaxBytes> bytes{};
    CanFrame again;
    const std::size_t n = encode_udp_multicast(frame, bytes);
    fuzz::require(decode_udp_multicast(std::span(bytes).first(n), again), "a frame can be written and read again");
    return 0;
}
