/// tests/protocols/capture.h - packets of real LiDARs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocols/little_endian.h"
#include "tests/support/read_file.h"

namespace narpa::test {

/// UDP payloads of this size in a capture of Ethernet frames; empty where there is no such file.
inline std::vector<std::vector<std::uint8_t>> captured_payloads(const std::string& path,
                                                                std::size_t payload_bytes) {
    const std::vector<std::uint8_t> file = read_bytes(path);
    std::vector<std::vector<std::uint8_t>> out;
    constexpr std::size_t kFileHeader = 24, kRecordHeader = 16, kFrameHeader = 42;
    for (std::size_t at = kFileHeader; at + kRecordHeader <= file.size();) {
        const auto length = get_le<std::uint32_t>(&file[at + 8]);
        at += kRecordHeader;
        if (length == kFrameHeader + payload_bytes && at + length <= file.size())
            out.emplace_back(&file[at + kFrameHeader], &file[at + kFrameHeader] + payload_bytes);
        at += length;
    }
    return out;
}

}  // namespace narpa::test
