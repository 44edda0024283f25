/// drivers/video/paced_datagrams.h - sinks that send each frame in UDP datagrams at a steady rate: a burst of a
/// whole frame would overflow the buffers of receivers.
///
/// Text: HOST[%INTERFACE]:PORT[,mtu=N][,mbit_s=N][,ttl=N], and options of the sink.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/descriptor.h"
#include "drivers/udp_route.h"
#include "drivers/video/backends.h"

namespace narpa {

/// Makes the datagrams of frames.
class FramePacketizer {
public:
    /// Of UDP; the two follow each other.
    struct Payload {
        std::span<const std::uint8_t> header, bytes;
    };
    virtual ~FramePacketizer() = default;
    /// Datagrams of a frame.
    [[nodiscard]] virtual std::uint32_t count() const noexcept = 0;
    /// Of a frame: the sum of its datagrams' payloads.
    [[nodiscard]] virtual std::size_t payload_bytes() const noexcept = 0;
    /// A datagram that is sent now; valid until the next call. A frame's come in order, from index 0.
    [[nodiscard]] virtual Payload payload(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                                          std::uint32_t index) noexcept = 0;
};

/// Where datagrams go, and how fast they leave.
struct DatagramTarget {
    Descriptor fd{};               ///< connected, so that a machine where nobody receives says so
    UdpAddress address{};          ///< as it was given
    UdpDestination destination{};  ///< with the port
    std::string what{};            ///< start of error texts: "udp:192.168.1.70:5004"
    int mtu = 1500;                ///< bytes of an IP packet
    int mbit_s = 1000;             ///< Ethernet's own bytes included

    /// `scheme`: "udp", the prefix of the sink without its colon.
    static Result<DatagramTarget> open(std::string_view scheme, const std::string& text,
                                       std::vector<UdpOption> options = {});
};

/// A sink that queues frames and sends them. Error: the rate is too low for the frames. `format`: of what the
/// packetizer gets; `datagrams`: what they are, start of the description; `remark`: its end.
VideoSinkResult paced_sink(DatagramTarget target, std::unique_ptr<FramePacketizer> packetizer,
                           const VideoFormat& format, WhenFull full, const std::string& datagrams,
                           const std::string& remark = {});

}  // namespace narpa
