/// protocols/captured_datagrams.h - UDP datagrams out of the frames of a capture: link layers, IP, fragments.
///
/// What is read and what is dropped: lidar/README.md, "What a capture may hold". Sources:
/// tcpdump.org/linktypes.html, IEEE 802.1Q, RFC 768, 791 and 8200. Checksums are not verified: frames captured
/// where they are sent may not have them yet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace narpa {

struct UdpDatagram {
    std::int64_t t_ns = 0;   ///< capture time of its first frame, ns since 1970
    std::string source;      ///< address: "192.168.1.201", "[fe80::1]"
    std::uint16_t port = 0;  ///< destination
    std::vector<std::uint8_t> payload;
};

/// Frames and why they gave no datagram.
struct CaptureCounters {
    std::uint64_t frames = 0;
    std::uint64_t other = 0;      ///< not UDP over IP
    std::uint64_t cut = 0;        ///< captured in part only: the snapshot length
    std::uint64_t malformed = 0;  ///< lengths that contradict each other
    std::uint64_t repeated = 0;   ///< captured before: the same fragment, or the same payload from the same address
    std::uint64_t incomplete = 0;  ///< datagrams, not frames: fragments are missing
};

class DatagramReader {
public:
    /// `link_type`: LINKTYPE_ value of the capture, one that reads_link() knows.
    explicit DatagramReader(int link_type) : link_type_(link_type) {}
    /// Ethernet, Linux cooked (two versions), raw IP, BSD loopback (two byte orders).
    [[nodiscard]] static bool reads_link(int link_type) noexcept;

    /// Takes a frame, `bytes` of its `length`. Frames may come in any order. `t_ns` >= 0: capture time.
    void take(std::int64_t t_ns, std::span<const std::uint8_t> bytes, std::size_t length);
    /// The datagrams of all frames by capture time, each once. To be called once, after the last frame.
    [[nodiscard]] std::vector<UdpDatagram> finish();
    /// Final after finish().
    [[nodiscard]] const CaptureCounters& counters() const noexcept { return counters_; }

private:
    enum class Fate : std::uint8_t { kept, other, cut, malformed };
    /// An IP packet, or a fragment of one.
    struct Packet {
        std::span<const std::uint8_t> addresses;  ///< source, destination
        std::uint8_t protocol = 0;                ///< of `body`
        std::span<const std::uint8_t> body;
        bool is_fragment = false, is_last = false;
        std::uint32_t id = 0;
        std::size_t offset = 0;  ///< of `body` in that of the whole packet
    };
    /// Fragments of one IP packet.
    struct Fragments {
        std::int64_t t_ns = 0;
        std::uint8_t protocol = 0;
        std::vector<std::uint8_t> bytes;  ///< empty once the packet is whole
        std::vector<bool> has;            ///< a byte has been captured
        std::size_t count = 0;            ///< of these bytes
        std::size_t size = 0;             ///< of all; 0: the last fragment is missing
        std::size_t datagram = 0;         ///< of a whole packet: its index, and the bytes before its payload
        std::size_t header_bytes = 0;

        [[nodiscard]] bool is_whole() const noexcept { return size > 0 && count == size; }
    };

    static Fate read_packet(int link_type, std::span<const std::uint8_t> bytes, Packet& out) noexcept;
    static Fate read_ipv4(std::span<const std::uint8_t> bytes, Packet& out) noexcept;
    static Fate read_ipv6(std::span<const std::uint8_t> bytes, Packet& out) noexcept;
    static Fate skip_extensions(Packet& packet) noexcept;
    /// Appends the datagram of a whole packet, with the number of bytes before its payload.
    Fate add(std::int64_t t_ns, const Packet& packet, std::size_t& header_bytes);
    Fate join(std::int64_t t_ns, const Packet& fragment);
    /// Whether the fragment can be of the same packet: the bytes that both have are equal.
    [[nodiscard]] bool is_consistent(const Fragments& known, const Packet& fragment) const noexcept;
    void drop_repeated();
    void count(Fate fate, bool is_cut) noexcept;

    int link_type_;
    CaptureCounters counters_{};
    std::vector<UdpDatagram> datagrams_;
    std::map<std::string, Fragments> fragments_;  ///< by addresses and identification
};

}  // namespace narpa
