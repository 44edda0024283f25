#include "protocols/captured_datagrams.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <unordered_map>

#include "base/time.h"
#include "protocols/big_endian.h"

namespace narpa {
namespace {

enum LinkType : int {
    kNull = 0,
    kEthernet = 1,
    kRawOfLinux = 12,  // DLT_RAW, which libpcap gives for 101
    kRaw = 101,
    kLoop = 108,
    kLinuxCooked = 113,
    kIpv4Only = 228,
    kIpv6Only = 229,
    kLinuxCooked2 = 276,
};
constexpr std::uint16_t kIpv4Type = 0x0800, kIpv6Type = 0x86DD;
constexpr std::array<std::uint16_t, 3> kVlanTypes{0x8100, 0x88A8, 0x9100};
constexpr std::size_t kIpv4Bytes = 20, kIpv6Bytes = 40, kUdpBytes = 8, kPacketBytesMax = 65535;
constexpr std::uint8_t kUdp = 17, kIpv6Fragment = 44, kAuthentication = 51;
/// Hop-by-hop, routing, authentication, destination options, mobility.
constexpr std::array<std::uint8_t, 5> kExtensions{0, 43, kAuthentication, 60, 135};
/// Fragments of one packet are captured within this; a later identification is that of another packet.
constexpr std::int64_t kFragments_ns = kSecond_ns;
/// The same payload again within this is the same datagram: a LiDAR's packets state their times.
constexpr std::int64_t kRepeated_ns = 60 * kSecond_ns;

template <class Kinds, class Kind>
bool contains(const Kinds& kinds, Kind kind) noexcept {
    return std::ranges::find(kinds, kind) != kinds.end();
}

std::string address_text(std::span<const std::uint8_t> address) {
    std::array<char, INET6_ADDRSTRLEN> text{};
    const bool is_v6 = address.size() > 4;
    ::inet_ntop(is_v6 ? AF_INET6 : AF_INET, address.data(), text.data(), text.size());
    return is_v6 ? "[" + std::string(text.data()) + "]" : text.data();
}

std::string_view text_of(std::span<const std::uint8_t> bytes) noexcept {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Bytes before the packet or its first VLAN tag, and where the header states the EtherType (0: it does not).
struct LinkHeader {
    std::size_t bytes = 0, type_at = 0;
    bool has_type = false;
};

LinkHeader link_header(int link_type) noexcept {
    switch (link_type) {
        case kEthernet: return {14, 12, true};
        case kLinuxCooked: return {16, 14, true};
        case kLinuxCooked2: return {20, 0, true};
        case kNull:
        case kLoop: return {4, 0, false};
        default: return {};
    }
}

}  // namespace

bool DatagramReader::reads_link(int link_type) noexcept {
    constexpr std::array<int, 9> known{kNull,        kEthernet, kRawOfLinux, kRaw,         kLoop,
                                       kLinuxCooked, kIpv4Only, kIpv6Only,   kLinuxCooked2};
    return contains(known, link_type);
}

DatagramReader::Fate DatagramReader::read_packet(int link_type, std::span<const std::uint8_t> bytes,
                                                 Packet& out) noexcept {
    const LinkHeader link = link_header(link_type);
    if (bytes.size() < link.bytes) return Fate::malformed;
    const std::uint8_t* type_at = bytes.data() + link.type_at;
    bytes = bytes.subspan(link.bytes);
    if (link.has_type) {
        auto type = get_be<std::uint16_t>(type_at);
        while (contains(kVlanTypes, type)) {  // tag control information, then the next type
            if (bytes.size() < 4) return Fate::malformed;
            type = get_be<std::uint16_t>(&bytes[2]);
            bytes = bytes.subspan(4);
        }
        if (type != kIpv4Type && type != kIpv6Type) return Fate::other;
    }
    if (bytes.empty()) return Fate::malformed;
    switch (bytes[0] >> 4) {
        case 4: return read_ipv4(bytes, out);
        case 6: return read_ipv6(bytes, out);
        default: return link.has_type ? Fate::malformed : Fate::other;
    }
}

DatagramReader::Fate DatagramReader::read_ipv4(std::span<const std::uint8_t> bytes, Packet& out) noexcept {
    if (bytes.size() < kIpv4Bytes) return Fate::malformed;
    const std::size_t header = 4 * std::size_t{bytes[0] & 0xFu};
    std::size_t total = get_be<std::uint16_t>(&bytes[2]);
    if (total == 0) total = bytes.size();  // left to the network card: the frame ends with the packet
    const auto flags = get_be<std::uint16_t>(&bytes[6]);
    constexpr unsigned kMoreFragments = 0x2000, kOffset = 0x1FFF;
    out.addresses = bytes.subspan(12, 8);
    out.protocol = bytes[9];
    out.id = get_be<std::uint16_t>(&bytes[4]);
    out.is_last = (flags & kMoreFragments) == 0;
    out.offset = 8 * std::size_t{flags & kOffset};
    out.is_fragment = !out.is_last || out.offset > 0;
    if (out.protocol != kUdp) return Fate::other;
    if (header < kIpv4Bytes || total < header || bytes.size() < total) return Fate::malformed;
    out.body = bytes.subspan(header, total - header);
    return Fate::kept;
}

DatagramReader::Fate DatagramReader::read_ipv6(std::span<const std::uint8_t> bytes, Packet& out) noexcept {
    if (bytes.size() < kIpv6Bytes) return Fate::malformed;
    std::size_t length = get_be<std::uint16_t>(&bytes[4]);
    if (length == 0) length = bytes.size() - kIpv6Bytes;
    out.addresses = bytes.subspan(8, 32);
    out.protocol = bytes[6];
    out.body = bytes.subspan(kIpv6Bytes).first(std::min(length, bytes.size() - kIpv6Bytes));
    const bool is_short = bytes.size() - kIpv6Bytes < length;
    const Fate extensions = skip_extensions(out);
    if (extensions != Fate::kept) return extensions;
    if (out.protocol == kIpv6Fragment) {
        if (out.body.size() < 8) return Fate::malformed;
        const auto flags = get_be<std::uint16_t>(&out.body[2]);
        out.is_fragment = true;
        out.is_last = (flags & 1) == 0;
        out.offset = flags & ~std::size_t{7};
        out.id = get_be<std::uint32_t>(&out.body[4]);
        out.protocol = out.body[0];
        out.body = out.body.subspan(8);
    }
    if (out.protocol != kUdp && !(out.is_fragment && contains(kExtensions, out.protocol))) return Fate::other;
    return is_short ? Fate::malformed : Fate::kept;
}

DatagramReader::Fate DatagramReader::skip_extensions(Packet& p) noexcept {
    while (contains(kExtensions, p.protocol)) {
        if (p.body.size() < 8) return Fate::malformed;
        const std::size_t units = p.body[1];
        const std::size_t length = p.protocol == kAuthentication ? 4 * (units + 2) : 8 * (units + 1);
        if (p.body.size() < length) return Fate::malformed;
        p.protocol = p.body[0];
        p.body = p.body.subspan(length);
    }
    return Fate::kept;
}

void DatagramReader::take(std::int64_t t_ns, std::span<const std::uint8_t> bytes, std::size_t length) {
    ++counters_.frames;
    Packet packet;
    Fate fate = read_packet(link_type_, bytes, packet);
    std::size_t header_bytes = 0;
    if (fate == Fate::kept) fate = packet.is_fragment ? join(t_ns, packet) : add(t_ns, packet, header_bytes);
    count(fate, bytes.size() < length);
}

void DatagramReader::count(Fate fate, bool is_cut) noexcept {
    if (fate == Fate::other) ++counters_.other;
    if (fate == Fate::malformed) ++(is_cut ? counters_.cut : counters_.malformed);
}

DatagramReader::Fate DatagramReader::add(std::int64_t t_ns, const Packet& packet, std::size_t& header_bytes) {
    Packet udp = packet;
    const Fate extensions = skip_extensions(udp);
    if (extensions != Fate::kept) return extensions;
    if (udp.protocol != kUdp) return Fate::other;
    if (udp.body.size() < kUdpBytes) return Fate::malformed;
    const std::size_t length = get_be<std::uint16_t>(&udp.body[4]);
    if (length < kUdpBytes || length > udp.body.size()) return Fate::malformed;
    const auto payload = udp.body.subspan(kUdpBytes, length - kUdpBytes);
    header_bytes = packet.body.size() - udp.body.size() + kUdpBytes;
    datagrams_.push_back({.t_ns = t_ns,
                          .source = address_text(udp.addresses.first(udp.addresses.size() / 2)),
                          .port = get_be<std::uint16_t>(&udp.body[2]),
                          .payload = {payload.begin(), payload.end()}});
    return Fate::kept;
}

bool DatagramReader::is_consistent(const Fragments& known, const Packet& fragment) const noexcept {
    const std::size_t end = fragment.offset + fragment.body.size();
    if (known.size > 0 && (end > known.size || (fragment.is_last && end != known.size))) return false;
    if (fragment.is_last && known.has.size() > end) return false;
    for (std::size_t i = fragment.offset; i < end; ++i) {
        std::uint8_t byte = fragment.body[i - fragment.offset];
        if (known.is_whole()) {
            const auto& payload = datagrams_[known.datagram].payload;
            if (i < known.header_bytes || i - known.header_bytes >= payload.size()) continue;
            if (payload[i - known.header_bytes] != byte) return false;
        } else if (i < known.has.size() && known.has[i] && known.bytes[i] != byte) {
            return false;
        }
    }
    return true;
}

DatagramReader::Fate DatagramReader::join(std::int64_t t_ns, const Packet& fragment) {
    const std::size_t end = fragment.offset + fragment.body.size();
    if (fragment.body.empty() || end > kPacketBytesMax || (!fragment.is_last && fragment.body.size() % 8 != 0))
        return Fate::malformed;
    std::string key(text_of(fragment.addresses));
    for (unsigned i = 0; i < 4; ++i) key += static_cast<char>(fragment.id >> (8 * i));
    Fragments& f = fragments_[key];
    const bool is_late = t_ns > f.t_ns + kFragments_ns || t_ns < f.t_ns - kFragments_ns;
    if (f.count > 0 && (is_late || !is_consistent(f, fragment))) {
        counters_.incomplete += f.is_whole() ? 0 : 1;
        f = {};
    }
    f.t_ns = f.count == 0 ? t_ns : std::min(f.t_ns, t_ns);
    if (f.is_whole()) {
        datagrams_[f.datagram].t_ns = f.t_ns;
        return ++counters_.repeated, Fate::kept;
    }
    if (fragment.offset == 0) f.protocol = fragment.protocol;
    if (fragment.is_last) f.size = end;
    if (f.bytes.size() < end) f.bytes.resize(end), f.has.resize(end);
    const std::size_t before = f.count;
    for (std::size_t i = fragment.offset; i < end; ++i) {
        f.count += f.has[i] ? 0 : 1;
        f.has[i] = true;
        f.bytes[i] = fragment.body[i - fragment.offset];
    }
    if (f.count == before) return ++counters_.repeated, Fate::kept;
    if (!f.is_whole()) return Fate::kept;

    Packet whole = fragment;
    whole.protocol = f.protocol;
    whole.body = f.bytes;
    const Fate fate = add(f.t_ns, whole, f.header_bytes);
    if (fate != Fate::kept) return fragments_.erase(key), fate;
    f.datagram = datagrams_.size() - 1;
    f.bytes = {}, f.has = {};
    return Fate::kept;
}

void DatagramReader::drop_repeated() {
    std::unordered_map<std::string, std::unordered_map<std::string_view, std::int64_t>> last_by_source;
    counters_.repeated += std::erase_if(datagrams_, [&](const UdpDatagram& d) {
        const auto [at, is_new] = last_by_source[d.source].try_emplace(text_of(d.payload), d.t_ns);
        const bool repeated = !is_new && d.t_ns - at->second <= kRepeated_ns;
        at->second = d.t_ns;
        return repeated;
    });
}

std::vector<UdpDatagram> DatagramReader::finish() {
    for (const auto& [key, f] : fragments_) counters_.incomplete += f.is_whole() ? 0 : 1;
    fragments_.clear();
    std::ranges::stable_sort(datagrams_, {}, &UdpDatagram::t_ns);
    drop_repeated();
    return std::move(datagrams_);
}

}  // namespace narpa
