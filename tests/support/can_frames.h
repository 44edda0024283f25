/// tests/support/can_frames.h - CAN frames of all kinds.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "protocols/can/frame.h"

namespace narpa {

inline CanFrame can_frame(std::uint32_t id, std::vector<std::uint8_t> data, bool extended = false) {
    CanFrame f;
    f.id = id;
    f.extended = extended;
    f.size = static_cast<std::uint8_t>(data.size());
    std::copy(data.begin(), data.end(), f.data.begin());
    return f;
}
inline CanFrame remote_frame(std::uint32_t id, std::uint8_t size, bool extended = false) {
    CanFrame f = can_frame(id, {}, extended);
    f.remote = true;
    f.size = size;
    return f;
}
inline CanFrame fd_frame(std::uint32_t id, std::vector<std::uint8_t> data, bool bit_rate_switch) {
    CanFrame f = can_frame(id, std::move(data));
    f.fd = true;
    f.bit_rate_switch = bit_rate_switch;
    return f;
}

inline bool same(const CanFrame& a, const CanFrame& b) {
    return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.error == b.error && a.fd == b.fd &&
           a.bit_rate_switch == b.bit_rate_switch && a.size == b.size && a.data == b.data;
}

}  // namespace narpa
