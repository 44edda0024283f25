/// protocols/can/slcan.h - LAWICEL text (slcan): lines that end in CR <-> CAN frames. No sockets.
///
/// t iii n dd..  data frame, 11-bit id (hex)     r iii n  remote frame
/// T iiiiiiii n dd..  the same with 29-bit id    R iiiiiiii n
/// d, D, b, B  CAN FD data frames, laid out as t and T, with 11-bit and 29-bit id; b, B with bit rate switch. n is
/// the DLC (hex): from 9 on 12, 16, 20, 24, 32, 48, 64 bytes (ISO 11898-1).
/// C close, O open, L open to listen only, Sn bit rate, Yn data bit rate of CAN FD, V version, N serial number, F
/// status. Sources: LAWICEL CANUSB manual, "ASCII commands"; CANable 2 firmware for CAN FD.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/can/frame.h"

namespace narpa {

/// "B1FFFFFFFF" + 128 digits + CR.
inline constexpr std::size_t kSlcanMaxLine = 139;

/// Writes the line with its CR and returns its length; 0 when slcan cannot carry the frame (error, bad id, a
/// length that CAN FD does not have).
[[nodiscard]] std::size_t encode_slcan(const CanFrame& frame, std::span<char, kSlcanMaxLine> out) noexcept;

/// One line without its CR. A time stamp of four digits after the data is allowed and ignored (LAWICEL Z1).
[[nodiscard]] bool decode_slcan(std::string_view line, CanFrame& out) noexcept;

/// Cuts a stream of bytes into lines. Lines longer than any valid one are dropped and counted.
class SlcanLines {
public:
    /// Takes bytes from the front of `bytes` up to and with the next line end (CR; LF and BEL end a line too) and
    /// returns true when `line()` now holds a line that is not empty; false when all bytes are used up.
    [[nodiscard]] bool next(std::span<const char>& bytes) noexcept;
    [[nodiscard]] std::string_view line() const noexcept { return {buffer_.data(), size_}; }
    /// Lines dropped because they were too long.
    [[nodiscard]] std::uint64_t overlong() const noexcept { return overlong_; }

    static constexpr std::size_t kLongest = 160;  ///< a CAN FD frame has up to 138, and 4 of a time stamp

private:
    std::array<char, kLongest> buffer_{};
    std::size_t size_ = 0;
    bool done_ = false, skipping_ = false;
    std::uint64_t overlong_ = 0;
};

}  // namespace narpa
