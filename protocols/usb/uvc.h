/// protocols/usb/uvc.h - a USB video class camera (UVC 1.0) that streams uncompressed frames over a bulk endpoint:
/// descriptors, stream negotiation, payload headers, controls. README.md in this folder has the tables.
///
/// Sources: USB Device Class Definition for Video Devices 1.0, and its Uncompressed payload; the format identifiers
/// as Linux' uvcvideo knows them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/pixel_format.h"

namespace narpa {

struct UvcIds {
    static constexpr std::uint8_t kControlInterface = 0, kStreamInterface = 1;
    static constexpr std::uint8_t kCamera = 1, kOutput = 2, kProcessing = 3;  ///< units and terminals
    static constexpr int kStream = 1;                                         ///< endpoint, bulk, towards the host
};

struct UvcRequest {
    static constexpr std::uint8_t kSetCurrent = 0x01, kGetCurrent = 0x81, kGetMinimum = 0x82, kGetMaximum = 0x83,
                                  kGetStep = 0x84, kGetLength = 0x85, kGetInfo = 0x86, kGetDefault = 0x87;
};
/// Selectors: the upper byte of wValue.
struct UvcControl {
    static constexpr std::uint8_t kProbe = 1, kCommit = 2;               ///< of the stream
    static constexpr std::uint8_t kExposureMode = 2, kExposureTime = 4;  ///< of the camera
    static constexpr std::uint8_t kGain = 4;                             ///< of the processing unit
    static constexpr std::uint8_t kErrorCode = 2;                        ///< of the control interface
};
/// Unit of exposure times.
inline constexpr std::int64_t kUvcExposureUnit_ns = 100'000;
inline constexpr std::uint32_t kUvcClock_hz = 48'000'000;

[[nodiscard]] constexpr bool uvc_carries(PixelFormat f) noexcept {
    return !row_of(f).uvc.empty();
}

/// The configuration of a camera of one format, size and rate. `with_controls`: exposure and gain.
[[nodiscard]] std::vector<std::uint8_t> uvc_configuration(const VideoFormat& format, bool with_controls);

/// What host and camera agree on before a stream: VS_PROBE_CONTROL and VS_COMMIT_CONTROL.
struct UvcProbe {
    std::uint16_t hint = 0;
    std::uint8_t format = 1, frame = 1;  ///< index
    std::uint32_t interval_100ns = 0;    ///< from frame to frame
    std::uint32_t frame_bytes = 0;
    std::uint32_t payload_bytes = 0;  ///< of a payload at most, with its header
    friend bool operator==(const UvcProbe&, const UvcProbe&) = default;
};
inline constexpr std::size_t kUvcProbeBytes = 26;
/// Linux asks for a payload in each transfer, 32 packets of 512 bytes.
inline constexpr std::uint32_t kUvcPayloadBytes = 16384;
[[nodiscard]] UvcProbe uvc_probe(const VideoFormat& format) noexcept;
[[nodiscard]] std::array<std::uint8_t, kUvcProbeBytes> encode_uvc_probe(const UvcProbe& probe) noexcept;
/// Nothing: shorter. Later versions of the class append fields, which are ignored.
[[nodiscard]] std::optional<UvcProbe> decode_uvc_probe(std::span<const std::uint8_t> bytes) noexcept;

/// Begins each payload.
struct UvcPayloadHeader {
    bool frame_id = false;  ///< toggles from frame to frame
    bool end_of_frame = false;
    std::uint32_t presentation = 0;  ///< when the frame was taken, ticks of kUvcClock_hz
    std::uint32_t source_clock = 0;  ///< when the payload was made, the same
    std::uint16_t bus_frame = 0;     ///< the same in USB frames (milliseconds), 11 bits
    friend bool operator==(const UvcPayloadHeader&, const UvcPayloadHeader&) = default;
};
inline constexpr std::size_t kUvcHeaderBytes = 12;
void encode_uvc_header(const UvcPayloadHeader& header, std::span<std::uint8_t, kUvcHeaderBytes> out) noexcept;
/// Nothing: shorter, or without time stamps.
[[nodiscard]] std::optional<UvcPayloadHeader> decode_uvc_header(std::span<const std::uint8_t> bytes) noexcept;
[[nodiscard]] constexpr std::uint32_t uvc_ticks(std::int64_t t_ns) noexcept {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(t_ns) * (kUvcClock_hz / 1'000'000) / 1000);
}

}  // namespace narpa
