/// tests/drivers/generated_capture.h - captures made from a seed, and what a reader has to find in them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocols/captured_datagrams.h"

namespace narpa::test {

struct GeneratedCapture {
    std::vector<std::uint8_t> file;
    bool gzip = false;    ///< to be written compressed
    bool is_cut = false;  ///< the file ends within a record
    /// Other programs can be expected to agree: no lengths that contradict each other, no identification twice, no
    /// frame cut.
    bool is_plain = false;
    std::vector<UdpDatagram> datagrams;  ///< expected
    CaptureCounters counters;            ///< expected
};

/// Link type, format, byte order, resolution, VLAN tags, IP version and headers, fragments, their order, repeats,
/// losses, other traffic and cuts depend on the seed.
[[nodiscard]] GeneratedCapture generated_capture(unsigned seed);

}  // namespace narpa::test
