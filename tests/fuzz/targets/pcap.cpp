// A capture of LiDAR packets.
#include "drivers/lidar/capture.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const auto capture = read_capture(folder.write("m.pcap", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(capture))) return fuzz::require(!capture.error().what.empty(), "an error has words"), 0;
    const CaptureCounters& c = capture->counters;
    fuzz::require(capture->datagrams.size() + c.other + c.cut + c.malformed + c.repeated <= c.frames,
                  "a frame is counted once");
    for (std::size_t i = 1; i < capture->datagrams.size(); ++i)
        fuzz::require(capture->datagrams[i - 1].t_ns <= capture->datagrams[i].t_ns, "datagrams are in order");
    return 0;
}
