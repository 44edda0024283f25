/// protocols/can/candump.h - one line of a candump log <-> a frame and its stamp.
///
/// (1700000000.250000) vcan0 123#DEADBEEF     data        (..) vcan0 18FF50E5#R4   remote, length 4
/// (1700000000.250000) vcan0 123##1DEADBEEF   CAN FD, the digit holds the flags (1 bit rate switch, 2 error state)
/// (1700000000.250000) vcan0 123#1122334455667788_E    the length code of 8 bytes (9 to F), which has no effect
/// (1700000000.250000) vcan0 45123#81:00:12345678#1122 CAN XL, which narpa does not carry
/// A trailing " R" or " T" (direction, as python-can writes it) is allowed. Source: can-utils, lib.h and candump.c.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/can/frame.h"

namespace narpa {

struct CandumpLine {
    std::int64_t t_ns = 0;  ///< stamp as in the line: usually Unix time
    CanFrame frame{};
    bool is_xl = false;               ///< CAN XL: `frame` is empty
    std::string_view interface = {};  ///< a part of the line
};

inline constexpr std::size_t kCandumpMaxLine = 224;

/// The error report that marks frames left out of a log. Source: linux/can/error.h, CAN_ERR_CRTL with
/// CAN_ERR_CRTL_RX_OVERFLOW; their number, little-endian, is in bytes 4..7, which this report does not use.
[[nodiscard]] CanFrame lost_frames(std::uint32_t count) noexcept;

/// Returns nullptr when the line (without its line end) is good, else what was expected; `out` is then unchanged.
[[nodiscard]] const char* parse_candump(std::string_view line, CandumpLine& out) noexcept;

/// If this first line is that of another kind of log, what converts it; else empty.
[[nodiscard]] std::string_view remedy_for_log(std::string_view first_line) noexcept;

/// Writes the line with its LF, microseconds as candump does and a time before 0 as 0; `interface` at most 15
/// characters. Returns its length.
[[nodiscard]] std::size_t format_candump(const CandumpLine& line, std::string_view interface,
                                         std::span<char, kCandumpMaxLine> out) noexcept;

}  // namespace narpa
