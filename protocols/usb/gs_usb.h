/// protocols/usb/gs_usb.h - the gs_usb protocol of USB-CAN adapters with candleLight firmware: control messages and
/// frames <-> plain structs. No libusb. README.md in this folder has the tables.
///
/// Sources: gs_usb.h and usbd_gs_can.c of candleLight_fw; drivers/net/can/usb/gs_usb.c of Linux 6.1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocols/can/frame.h"

namespace narpa {

/// Vendor requests to the interface. `wValue` is the channel, except in the two that say so.
enum class GsUsbRequest : std::uint8_t {
    host_format = 0,  ///< wValue 1
    bit_timing = 1,
    mode = 2,
    bit_timing_limits = 4,
    device_config = 5,  ///< wValue 1
    time_stamp = 6,
    identify = 7,
    data_bit_timing = 10,
    bit_timing_limits_fd = 11,
    state = 14,
};

/// Features of an adapter. Some of them are also requested when a channel starts.
struct GsUsbFeature {
    static constexpr std::uint32_t kListenOnly = 1 << 0, kLoopBack = 1 << 1, kOneShot = 1 << 3, kTimeStamp = 1 << 4,
                                   kIdentify = 1 << 5, kFd = 1 << 8, kLimitsFd = 1 << 10, kErrorReports = 1 << 12,
                                   kState = 1 << 13;
};

/// Which byte order the host speaks. All adapters want little-endian.
inline constexpr std::array<std::uint8_t, 4> kGsUsbHostFormat{0xef, 0xbe, 0x00, 0x00};

struct GsUsbConfig {
    std::uint8_t channels = 1;
    std::uint32_t software = 2, hardware = 1;  ///< versions
    friend bool operator==(const GsUsbConfig&, const GsUsbConfig&) = default;
};
inline constexpr std::size_t kGsUsbConfigBytes = 12;
[[nodiscard]] std::array<std::uint8_t, kGsUsbConfigBytes> encode_gs_usb_config(const GsUsbConfig& c) noexcept;
[[nodiscard]] std::optional<GsUsbConfig> decode_gs_usb_config(std::span<const std::uint8_t> bytes) noexcept;

/// The ranges of a bit timing, in time quanta (ISO 11898-1).
struct BitTimingRange {
    std::uint32_t tseg1_min = 1, tseg1_max = 16;  ///< propagation and first phase segment
    std::uint32_t tseg2_min = 1, tseg2_max = 8;   ///< second phase segment
    std::uint32_t sjw_max = 4;
    std::uint32_t brp_min = 1, brp_max = 1024, brp_step = 1;  ///< prescaler
    friend bool operator==(const BitTimingRange&, const BitTimingRange&) = default;
};
struct GsUsbLimits {
    std::uint32_t features = 0;
    std::uint32_t clock_hz = 48'000'000;
    BitTimingRange nominal{};
    std::optional<BitTimingRange> data{};  ///< of CAN FD's data phase; only in the long form
    friend bool operator==(const GsUsbLimits&, const GsUsbLimits&) = default;
};
inline constexpr std::size_t kGsUsbLimitsBytes = 40, kGsUsbLimitsFdBytes = 72;
/// Writes the limits, in the long form if `data` has a value, and returns the size.
std::size_t encode_gs_usb_limits(const GsUsbLimits& limits,
                                 std::span<std::uint8_t, kGsUsbLimitsFdBytes> out) noexcept;
/// Nothing: another size, no clock, or ranges that hold no bit timing.
[[nodiscard]] std::optional<GsUsbLimits> decode_gs_usb_limits(std::span<const std::uint8_t> bytes) noexcept;

struct BitTiming {
    std::uint32_t prop_seg = 0, phase_seg1 = 0, phase_seg2 = 0, sjw = 0, brp = 0;
    /// Time quanta of a bit: the synchronisation segment is one.
    [[nodiscard]] std::uint32_t quanta() const noexcept { return 1 + prop_seg + phase_seg1 + phase_seg2; }
    friend bool operator==(const BitTiming&, const BitTiming&) = default;
};
inline constexpr std::size_t kGsUsbBitTimingBytes = 20;
[[nodiscard]] std::array<std::uint8_t, kGsUsbBitTimingBytes> encode_gs_usb_bit_timing(const BitTiming& t) noexcept;
[[nodiscard]] std::optional<BitTiming> decode_gs_usb_bit_timing(std::span<const std::uint8_t> bytes) noexcept;
/// The timing of exactly this bit rate whose sample point is nearest to the one that CiA 301 recommends: 87.5 % up
/// to 500 kbit/s, 80 % up to 800 kbit/s, 75 % above. Nothing: the clock cannot be divided so.
[[nodiscard]] std::optional<BitTiming> bit_timing_of(std::uint32_t bit_rate, std::uint32_t clock_hz,
                                                     const BitTimingRange& range) noexcept;

struct GsUsbMode {
    bool start = false;          ///< false: reset
    std::uint32_t features = 0;  ///< those that are wanted
    friend bool operator==(const GsUsbMode&, const GsUsbMode&) = default;
};
inline constexpr std::size_t kGsUsbModeBytes = 8;
[[nodiscard]] std::array<std::uint8_t, kGsUsbModeBytes> encode_gs_usb_mode(const GsUsbMode& mode) noexcept;
[[nodiscard]] std::optional<GsUsbMode> decode_gs_usb_mode(std::span<const std::uint8_t> bytes) noexcept;

/// A frame between host and adapter, on a bulk endpoint.
struct GsUsbFrame {
    /// `echo` of a frame that came from the bus. A frame of the host is sent back, with its echo, once the bus has
    /// it.
    static constexpr std::uint32_t kReceived = 0xffff'ffff;
    std::uint32_t echo = kReceived;
    std::uint8_t channel = 0;
    bool overflow = false;      ///< the adapter has lost frames before this one
    bool error_state = false;   ///< CAN FD's ESI
    CanFrame frame{};           ///< an error report has its class in `id`, as SocketCAN numbers them
    std::uint32_t time_us = 0;  ///< the adapter's clock, which wraps; only with GsUsbFeature::kTimeStamp
};
inline constexpr std::size_t kGsUsbFrameMostBytes = 12 + 64 + 4;
/// Writes the frame and returns its size. CAN FD data is padded with zeros to a length of CAN FD.
std::size_t encode_gs_usb_frame(const GsUsbFrame& frame, bool with_time,
                                std::span<std::uint8_t, kGsUsbFrameMostBytes> out) noexcept;
/// Bytes behind the frame are ignored: on a CAN FD channel Linux sends classic frames as long as those of CAN FD.
/// Nothing: too short or too long, a length code of classic CAN above 8, a remote CAN FD frame.
[[nodiscard]] std::optional<GsUsbFrame> decode_gs_usb_frame(std::span<const std::uint8_t> bytes,
                                                            bool with_time) noexcept;

/// Classes of error reports (linux/can/error.h).
struct CanErrorClass {
    static constexpr std::uint32_t kController = 0x4, kAcknowledge = 0x20, kBusOff = 0x40, kBusError = 0x80,
                                   kRestarted = 0x100;
};

}  // namespace narpa
