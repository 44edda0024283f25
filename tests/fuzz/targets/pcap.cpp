// A capture of LiDAR packets.
#include "drivers/lidar/packet_source.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const auto packets = read_datagrams(folder.write("m.pcap", fuzz::text_of(data, size)), 1206);
    if (!fuzz::count(bool(packets))) return fuzz::require(!packets.error().what.empty(), "an error has words"), 0;
    for (const auto& packet : *packets) fuzz::require(packet.size() == 1206, "packets have the size asked for");
    return 0;
}
