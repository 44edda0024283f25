/// tests/support/ptp_answer.h - answers of ptp4l to management requests, byte by byte. Layouts: IEEE
/// 1588-2008, 13.3, 15.4, 15.5; linuxptp, tlv.h. Without narpa's encoder.
#pragma once

#include <cstdint>
#include <vector>

#include "protocols/ptp/management.h"

namespace narpa::test {

using PtpBytes = std::vector<std::uint8_t>;

inline void append(PtpBytes& bytes, std::uint64_t value, int size) {
    for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// A response to `asker` whose TLV has this type and these bytes after the length.
inline PtpBytes ptp_response(std::uint16_t sequence, const PtpPortIdentity& asker, std::uint16_t tlv_type,
                             const PtpBytes& tlv) {
    PtpBytes b{0x0D, 0x12};  // management; version 2.1, as of linuxptp 4
    append(b, 34 + 10 + 4 + 4 + tlv.size(), 2);
    b.resize(b.size() + 1 + 1 + 2 + 8 + 4);             // domain, reserved, flags, correction, reserved
    append(b, 0x525400FFFE123456, 8), append(b, 1, 2);  // source
    append(b, sequence, 2), append(b, 4, 1), append(b, 0x7F, 1);
    b.insert(b.end(), asker.clock.begin(), asker.clock.end());
    append(b, asker.port, 2);
    append(b, 0, 2), append(b, 2, 1), append(b, 0, 1);  // hops, RESPONSE, reserved
    append(b, tlv_type, 2), append(b, tlv.size(), 2);
    b.insert(b.end(), tlv.begin(), tlv.end());
    return b;
}

inline PtpBytes ptp_answer(std::uint16_t sequence, const PtpPortIdentity& asker, std::uint16_t id,
                           const PtpBytes& data) {
    PtpBytes tlv;
    append(tlv, id, 2);
    tlv.insert(tlv.end(), data.begin(), data.end());
    return ptp_response(sequence, asker, 1, tlv);
}

/// MANAGEMENT_ERROR_STATUS, "not supported".
inline PtpBytes ptp_error(std::uint16_t sequence, const PtpPortIdentity& asker, std::uint16_t id) {
    PtpBytes tlv;
    append(tlv, 6, 2), append(tlv, id, 2), append(tlv, 0, 4);
    return ptp_response(sequence, asker, 2, tlv);
}

inline PtpBytes ptp_current(std::uint16_t steps_removed, std::int64_t offset_ns, std::int64_t delay_ns) {
    PtpBytes data;
    append(data, steps_removed, 2);
    append(data, static_cast<std::uint64_t>(offset_ns * 65536), 8);
    append(data, static_cast<std::uint64_t>(delay_ns * 65536), 8);
    return data;
}

inline PtpBytes ptp_port(std::uint16_t port, std::uint8_t state) {
    PtpBytes data;
    append(data, 0x525400FFFE123456, 8), append(data, port, 2), append(data, state, 1);
    append(data, 0, 1), append(data, 0, 8);  // delay request interval, peer delay
    append(data, 1, 1), append(data, 3, 1), append(data, 0, 1), append(data, 1, 1), append(data, 0, 1),
        append(data, 2, 1);
    return data;
}

inline PtpBytes ptp_time_status(bool present, const PtpClockIdentity& grandmaster) {
    PtpBytes data;
    append(data, 0, 8), append(data, 0, 8), append(data, 0, 4), append(data, 0, 4), append(data, 0, 2);
    append(data, 0, 2), append(data, 0, 8), append(data, 0, 2);  // ScaledNs: 96 bits
    append(data, present ? 1 : 0, 4);
    data.insert(data.end(), grandmaster.begin(), grandmaster.end());
    return data;
}

}  // namespace narpa::test
