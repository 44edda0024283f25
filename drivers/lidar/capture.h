/// drivers/lidar/capture.h - capture files, as tcpdump, Wireshark and narpa write them.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "protocols/captured_datagrams.h"

namespace narpa {

struct Capture {
    std::vector<UdpDatagram> datagrams;  ///< by capture time, each once
    CaptureCounters counters;
    std::string cut;  ///< why the file's end could not be read; empty: it was read to its end
};

/// Reads pcap, and pcapng with one link type, plain or compressed by gzip. What is whole in a file cut short is
/// used. Errors: not a capture, compressed otherwise, a link type that DatagramReader does not read.
[[nodiscard]] Result<Capture> read_capture(const std::string& path);

}  // namespace narpa
