#include "protocols/usb/uvc.h"

#include <algorithm>
#include <limits>

#include "protocols/little_endian.h"
#include "protocols/usb/descriptors.h"

namespace narpa {
namespace {

constexpr std::uint8_t kVideoClass = 0x0e, kControlSubclass = 1, kStreamingSubclass = 2, kCollection = 3;
constexpr std::uint16_t kUvcVersion = 0x0100, kCameraTerminal = 0x0201, kStreamingTerminal = 0x0101;
constexpr std::uint16_t kBulkPacket = 512;  // of a high-speed device

/// Puts one class-specific descriptor together.
class UvcDescriptor {
public:
    UvcDescriptor(std::uint8_t type, std::uint8_t subtype) : bytes_{0, type, subtype} {}
    template <std::unsigned_integral T>
    UvcDescriptor& put(T value) {
        bytes_.resize(bytes_.size() + sizeof value);
        put_le(bytes_.data() + bytes_.size() - sizeof value, value);
        return *this;
    }
    UvcDescriptor& put(std::span<const std::uint8_t> bytes) {
        bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
        return *this;
    }
    [[nodiscard]] std::vector<std::uint8_t> bytes() const {
        std::vector<std::uint8_t> b = bytes_;
        b[0] = static_cast<std::uint8_t>(b.size());
        return b;
    }

private:
    std::vector<std::uint8_t> bytes_;
};

constexpr std::uint8_t operator""_u8(unsigned long long value) {
    return static_cast<std::uint8_t>(value);
}

UvcDescriptor interface_descriptor(std::uint8_t subtype) {
    return {UsbDescriptorType::kClassInterface, subtype};
}

/// The format's GUID: "YUY2", "Y16 " or "Y800", and the fixed bytes of Microsoft's media subtypes.
std::array<std::uint8_t, 16> format_guid(PixelFormat f) {
    std::array<std::uint8_t, 16> guid{0, 0, 0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71};
    std::ranges::copy(row_of(f).uvc, guid.begin());
    return guid;
}

std::uint32_t interval_100ns(const VideoFormat& f) noexcept {
    return static_cast<std::uint32_t>(
        std::clamp<std::int64_t>(f.period_ns / 100, 1, std::numeric_limits<std::uint32_t>::max()));
}

void append(std::vector<std::uint8_t>& to, const UvcDescriptor& d) {
    const auto bytes = d.bytes();
    to.insert(to.end(), bytes.begin(), bytes.end());
}

std::vector<std::uint8_t> control_descriptors(bool with_controls) {
    // Bits: exposure mode and time of the camera, gain of the processing unit.
    const std::uint8_t camera_controls = with_controls ? 1 << 1 | 1 << 3 : 0;
    const std::uint16_t processing_controls = with_controls ? 1 << 9 : 0;
    std::vector<std::uint8_t> units;
    append(units, interface_descriptor(2)  // input terminal
                      .put(UvcIds::kCamera)
                      .put(kCameraTerminal)
                      .put(0_u8)
                      .put(0_u8)
                      .put(std::uint16_t{0})
                      .put(std::uint16_t{0})
                      .put(std::uint16_t{0})
                      .put(3_u8)
                      .put(camera_controls)
                      .put(0_u8)
                      .put(0_u8));
    append(units, interface_descriptor(5)  // processing unit
                      .put(UvcIds::kProcessing)
                      .put(UvcIds::kCamera)
                      .put(std::uint16_t{0})
                      .put(2_u8)
                      .put(processing_controls)
                      .put(0_u8));
    append(units, interface_descriptor(3)  // output terminal
                      .put(UvcIds::kOutput)
                      .put(kStreamingTerminal)
                      .put(0_u8)
                      .put(UvcIds::kProcessing)
                      .put(0_u8));
    constexpr std::size_t kHeader = 13;
    std::vector<std::uint8_t> all = interface_descriptor(1)
                                        .put(kUvcVersion)
                                        .put(static_cast<std::uint16_t>(kHeader + units.size()))
                                        .put(kUvcClock_hz)
                                        .put(1_u8)
                                        .put(UvcIds::kStreamInterface)
                                        .bytes();
    all.insert(all.end(), units.begin(), units.end());
    return all;
}

std::vector<std::uint8_t> stream_descriptors(const VideoFormat& f) {
    const UvcProbe probe = uvc_probe(f);
    const auto bits = static_cast<std::uint8_t>(8 * bytes_per_pixel(f.pixel));
    const std::uint64_t bit_rate = std::uint64_t{8} * probe.frame_bytes * 10'000'000 / probe.interval_100ns;
    const auto rate = static_cast<std::uint32_t>(std::min<std::uint64_t>(bit_rate, UINT32_MAX));
    std::vector<std::uint8_t> formats;
    append(formats, interface_descriptor(4)  // an uncompressed format with one frame size
                        .put(1_u8)
                        .put(1_u8)
                        .put(format_guid(f.pixel))
                        .put(bits)
                        .put(1_u8)
                        .put(0_u8)
                        .put(0_u8)
                        .put(0_u8)
                        .put(0_u8));
    append(formats, interface_descriptor(5)  // a frame size with one interval
                        .put(1_u8)
                        .put(0_u8)
                        .put(static_cast<std::uint16_t>(f.width))
                        .put(static_cast<std::uint16_t>(f.height))
                        .put(rate)
                        .put(rate)
                        .put(probe.frame_bytes)
                        .put(probe.interval_100ns)
                        .put(1_u8)
                        .put(probe.interval_100ns));
    append(formats, interface_descriptor(13).put(1_u8).put(1_u8).put(4_u8));  // BT.709 primaries, BT.601 matrix
    constexpr std::size_t kHeader = 14;
    std::vector<std::uint8_t> all = interface_descriptor(1)
                                        .put(1_u8)
                                        .put(static_cast<std::uint16_t>(kHeader + formats.size()))
                                        .put(static_cast<std::uint8_t>(0x80 | UvcIds::kStream))
                                        .put(0_u8)
                                        .put(UvcIds::kOutput)
                                        .put(0_u8)
                                        .put(0_u8)
                                        .put(0_u8)
                                        .put(1_u8)
                                        .put(0_u8)
                                        .bytes();
    all.insert(all.end(), formats.begin(), formats.end());
    return all;
}

}  // namespace

std::vector<std::uint8_t> uvc_configuration(const VideoFormat& format, bool with_controls) {
    constexpr std::array<std::uint8_t, 8> kAssociation{
        8, UsbDescriptorType::kAssociation, UvcIds::kControlInterface, 2, kVideoClass, kCollection, 0, 2};
    constexpr std::uint8_t kBulk = 2;
    return UsbConfigurationWriter(2, 500)
        .add(kAssociation)
        .interface({UvcIds::kControlInterface, 0, kVideoClass, kControlSubclass, 0}, 0)
        .add(control_descriptors(with_controls))
        .interface({UvcIds::kStreamInterface, 0, kVideoClass, kStreamingSubclass, 0}, 1)
        .add(stream_descriptors(format))
        .endpoint({0x80 | UvcIds::kStream, kBulk, kBulkPacket})
        .bytes();
}

UvcProbe uvc_probe(const VideoFormat& format) noexcept {
    UvcProbe p;
    p.hint = 1;
    p.interval_100ns = interval_100ns(format);
    p.frame_bytes = static_cast<std::uint32_t>(frame_bytes(format));
    p.payload_bytes = kUvcPayloadBytes;
    return p;
}

std::array<std::uint8_t, kUvcProbeBytes> encode_uvc_probe(const UvcProbe& p) noexcept {
    std::array<std::uint8_t, kUvcProbeBytes> b{};
    put_le(&b[0], p.hint);
    b[2] = p.format, b[3] = p.frame;
    put_le(&b[4], p.interval_100ns), put_le(&b[18], p.frame_bytes), put_le(&b[22], p.payload_bytes);
    return b;
}

std::optional<UvcProbe> decode_uvc_probe(std::span<const std::uint8_t> b) noexcept {
    if (b.size() < kUvcProbeBytes) return std::nullopt;
    return UvcProbe{
        get_le<std::uint16_t>(&b[0]), b[2], b[3], get_le<std::uint32_t>(&b[4]), get_le<std::uint32_t>(&b[18]),
        get_le<std::uint32_t>(&b[22])};
}

void encode_uvc_header(const UvcPayloadHeader& h, std::span<std::uint8_t, kUvcHeaderBytes> out) noexcept {
    constexpr std::uint8_t kHeaderEnds = 0x80, kHasSourceClock = 8, kHasPresentation = 4;
    out[0] = kUvcHeaderBytes;
    out[1] = static_cast<std::uint8_t>(kHeaderEnds | kHasSourceClock | kHasPresentation | (h.end_of_frame ? 2 : 0) |
                                       (h.frame_id ? 1 : 0));
    put_le(&out[2], h.presentation), put_le(&out[6], h.source_clock);
    put_le(&out[10], static_cast<std::uint16_t>(h.bus_frame & 0x7ff));
}

std::optional<UvcPayloadHeader> decode_uvc_header(std::span<const std::uint8_t> b) noexcept {
    if (b.size() < kUvcHeaderBytes || b[0] != kUvcHeaderBytes || (b[1] & 0x0c) != 0x0c) return std::nullopt;
    return UvcPayloadHeader{(b[1] & 1) != 0, (b[1] & 2) != 0, get_le<std::uint32_t>(&b[2]),
                            get_le<std::uint32_t>(&b[6]), get_le<std::uint16_t>(&b[10])};
}

}  // namespace narpa
