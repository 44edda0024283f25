#include "tests/drivers/generated_capture.h"

#include <algorithm>
#include <array>
#include <optional>
#include <random>

#include "protocols/big_endian.h"
#include "protocols/little_endian.h"

namespace narpa::test {
namespace {

using Octets = std::vector<std::uint8_t>;

/// A frame, and which part of which datagram it holds.
struct Frame {
    std::int64_t t_ns = 0;
    Octets bytes;
    std::size_t length = 0;  ///< on the wire
    int datagram = -1;       ///< -1: other traffic
    int part = 0;
    bool malformed = false;

    [[nodiscard]] bool is_whole() const { return bytes.size() == length && !malformed; }
};

/// A datagram to be sent, and the parts that it is sent in.
struct Sent {
    UdpDatagram datagram;
    std::size_t parts = 1;
    bool is_fragmented = false;
};

class Generator {
public:
    explicit Generator(unsigned seed) : random_(seed) {}

    GeneratedCapture make() {
        constexpr std::array<int, 6> kLinks{1, 113, 276, 101, 0, 108};
        link_ = kLinks[below(kLinks.size())];
        big_endian_ = one_in(3);
        constant_id_ = one_in(6);
        is_plain_ = !constant_id_;
        nanoseconds_ = one_in(2);
        const std::size_t n = 1 + below(12);
        for (std::size_t i = 0; i < n; ++i) {
            put_datagram();
            if (one_in(4)) put_other();
            t_ns_ += 10'000'000;
        }
        if (!constant_id_ && one_in(2)) std::ranges::shuffle(frames_, random_);
        GeneratedCapture out;
        out.gzip = one_in(4);
        const bool pcapng = one_in(3);
        write(pcapng, !out.gzip && one_in(4), out);
        expect(out);
        return out;
    }

private:
    std::size_t below(std::size_t n) { return random_() % n; }
    bool one_in(std::size_t n) { return below(n) == 0; }
    Octets noise(std::size_t n) {
        Octets out(n);
        for (auto& b : out) b = static_cast<std::uint8_t>(random_());
        return out;
    }
    static void append(Octets& to, const Octets& what) { to.insert(to.end(), what.begin(), what.end()); }
    static void append_be16(Octets& to, std::size_t value) {
        to.push_back(static_cast<std::uint8_t>(value >> 8));
        to.push_back(static_cast<std::uint8_t>(value));
    }

    [[nodiscard]] bool has_type() const { return link_ == 1 || link_ == 113 || link_ == 276; }
    /// The frame of an IP packet, or of another EtherType.
    Octets framed(const Octets& packet, std::size_t type) {
        Octets out;
        if (link_ == 0 || link_ == 108) {  // address family: in network order, or that of the machine
            const std::uint8_t family = type == 0x0800 ? 2 : std::array<std::uint8_t, 3>{24, 28, 30}[below(3)];
            out = link_ == 108 || big_endian_ ? Octets{0, 0, 0, family} : Octets{family, 0, 0, 0};
        }
        if (link_ == 1) out = noise(12);
        if (link_ == 113) out = noise(14);
        std::vector<std::size_t> types;
        for (const auto& [tag, vlan] : tags_) types.push_back(tag);
        types.push_back(type);
        if (link_ == 276) {
            append_be16(out, types[0]);
            append(out, Octets{0, 0, 0, 0, 0, 3, 0, 1, 0, 6});
            append(out, noise(8));
        } else if (link_ == 1 || link_ == 113) {
            append_be16(out, types[0]);
        }
        for (std::size_t i = 1; i < types.size(); ++i) {
            append_be16(out, tags_[i - 1].second);
            append_be16(out, types[i]);
        }
        append(out, packet);
        return out;
    }

    /// VLAN tags of the next frames: none, one or two.
    void choose_tags() {
        constexpr std::array<std::size_t, 3> kTags{0x8100, 0x88A8, 0x9100};
        tags_.clear();
        if (has_type() && one_in(3))
            for (std::size_t n = 1 + below(2); n > 0; --n)
                tags_.emplace_back(kTags[below(kTags.size())], below(4096));
    }

    Octets ipv4(std::uint8_t protocol, const Octets& body, std::size_t fragment, bool states_length) {
        const Octets options = one_in(5) ? Octets(4 * (1 + below(10)), 1) : Octets{};  // 1: no operation
        const std::size_t header = 20 + options.size(), total = header + body.size();
        Octets out{static_cast<std::uint8_t>(0x40 | (header / 4)), 0};
        append_be16(out, states_length ? total : 0);
        append_be16(out, id_);
        append_be16(out, fragment);
        append(out, {64, protocol, 0, 0, 192, 168, 1, unit_, 255, 255, 255, 255});
        append(out, options);
        append(out, body);
        return out;
    }

    Octets ipv6(std::uint8_t next, const Octets& body, std::optional<std::size_t> fragment) {
        Octets extensions;
        const std::uint8_t inner = next;
        if (fragment) {
            append(extensions, {inner, 0});
            append_be16(extensions, *fragment);
            append_be16(extensions, 0);
            append_be16(extensions, id_);
            next = 44;
        }
        if (one_in(3)) {  // hop-by-hop options: padding
            Octets before{next, 0, 1, 4, 0, 0, 0, 0};
            append(before, extensions);
            extensions = before, next = 0;
        }
        Octets out{0x60, 0, 0, 0};
        append_be16(out, extensions.size() + body.size());
        append(out, {next, 64, 0xFE, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, unit_});
        append(out, {0xFF, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1});
        append(out, extensions);
        append(out, body);
        return out;
    }

    void put_frame(const Octets& packet, std::size_t type, int datagram, int part, bool padded) {
        Frame f{.t_ns = t_ns_ + 1000 * static_cast<std::int64_t>(frames_.size() % 100),
                .bytes = framed(packet, type),
                .datagram = datagram,
                .part = part};
        if (padded) append(f.bytes, noise(1 + below(18)));
        f.length = f.bytes.size();
        constexpr std::size_t kHeaders = 80;
        if (!padded && !constant_id_ && f.length > kHeaders && one_in(40)) {
            f.bytes.resize(kHeaders + below(f.length - kHeaders));
            is_plain_ = false;
        }
        frames_.push_back(f);
        if (datagram >= 0 && one_in(10)) {
            f.t_ns += 1000;
            frames_.push_back(f);
        }
    }

    void put_datagram() {
        const int number = static_cast<int>(sent_.size());
        const bool is_v6 = one_in(3);
        unit_ = static_cast<std::uint8_t>(201 + below(3));
        choose_tags();
        if (!constant_id_) ++id_;
        Sent s;
        s.datagram.source = is_v6 ? "[fe80::" + hex(unit_) + "]" : "192.168.1." + std::to_string(unit_);
        s.datagram.port = static_cast<std::uint16_t>(1024 + below(60'000));
        s.datagram.payload = noise(one_in(3) ? 8 + below(6000) : 8 + below(1400));
        put_be<std::uint64_t>(s.datagram.payload.data(), static_cast<std::uint64_t>(number));  // each is another

        Octets udp;
        append_be16(udp, 1024 + below(60'000));
        append_be16(udp, s.datagram.port);
        append_be16(udp, 8 + s.datagram.payload.size());
        append_be16(udp, 0);
        append(udp, s.datagram.payload);
        s.is_fragmented = one_in(2);
        const bool malformed = !s.is_fragmented && one_in(20);
        if (malformed) put_be<std::uint16_t>(&udp[4], one_in(2) ? 7 : 0xFFFF), is_plain_ = false;
        std::uint8_t protocol = 17;
        if (is_v6 && one_in(3)) {  // destination options: padding
            Octets with{17, 0, 1, 4, 0, 0, 0, 0};
            append(with, udp);
            udp = with, protocol = 60;
        }
        const std::size_t part = s.is_fragmented ? 8 * (8 + below(180)) : udp.size();
        s.parts = (udp.size() + part - 1) / part;
        if (!is_v6 && s.parts == 1) s.is_fragmented = false;
        sent_.push_back(s);
        const int lost = !constant_id_ && s.parts > 1 && one_in(8) ? static_cast<int>(below(s.parts)) : -1;
        for (std::size_t i = 0; i < s.parts; ++i) {
            if (static_cast<int>(i) == lost) continue;
            const auto begin = udp.begin() + static_cast<std::ptrdiff_t>(i * part);
            const Octets body(begin, begin + static_cast<std::ptrdiff_t>(std::min(part, udp.size() - i * part)));
            const bool more = i + 1 < s.parts, padded = one_in(5);
            const Octets packet =
                is_v6 ? ipv6(protocol, body,
                             s.is_fragmented ? std::optional(i * part | (more ? 1 : 0)) : std::nullopt)
                      : ipv4(protocol, body, i * part / 8 | (more ? 0x2000 : 0),
                             padded || s.is_fragmented || !one_in(8));
            const std::size_t first = frames_.size();
            put_frame(packet, is_v6 ? 0x86DD : 0x0800, number, static_cast<int>(i), padded);
            for (std::size_t k = first; k < frames_.size(); ++k) frames_[k].malformed = malformed;
        }
    }

    void put_other() {
        switch (below(has_type() ? 4 : 2)) {
            case 0: return put_frame(ipv4(6, noise(40), 0, !one_in(8)), 0x0800, -1, 0, false);
            case 1: return put_frame(ipv6(58, noise(40), std::nullopt), 0x86DD, -1, 0, false);
            case 2: return put_frame(noise(46), 0x0806, -1, 0, false);
            default: return put_frame(noise(60), 0x88CC, -1, 0, false);
        }
    }

    static std::string hex(std::uint8_t value) {
        constexpr std::string_view digits = "0123456789abcdef";
        return {digits[value / 16], digits[value % 16]};
    }

    template <class T>
    void put(Octets& to, T value) const {
        to.resize(to.size() + sizeof(T));
        std::uint8_t* at = &to[to.size() - sizeof(T)];
        big_endian_ ? put_be(at, value) : put_le(at, value);
    }
    void put32(Octets& to, std::uint64_t value) const { put(to, static_cast<std::uint32_t>(value)); }

    /// A pcapng block of this content.
    void put_block(Octets& to, unsigned type, Octets body) const {
        body.resize((body.size() + 3) / 4 * 4);
        put32(to, type);
        put32(to, body.size() + 12);
        append(to, body);
        put32(to, body.size() + 12);
    }

    Octets header(bool pcapng) const {
        Octets out, section, interface;
        const auto link = static_cast<std::uint16_t>(link_);
        if (!pcapng) {
            put32(out, nanoseconds_ ? 0xA1B23C4D : 0xA1B2C3D4);
            put32(out, big_endian_ ? 0x0002'0004 : 0x0004'0002);
            put32(out, 0), put32(out, 0), put32(out, 262'144), put32(out, link);
            return out;
        }
        put32(section, 0x1A2B3C4D);
        put(section, std::uint16_t{1}), put(section, std::uint16_t{0});
        put32(section, 0xFFFF'FFFF), put32(section, 0xFFFF'FFFF);
        put_block(out, 0x0A0D0D0A, section);
        put(interface, link), put(interface, std::uint16_t{0});
        put32(interface, 262'144);
        if (nanoseconds_) {
            put(interface, std::uint16_t{9}), put(interface, std::uint16_t{1});
            append(interface, {9, 0, 0, 0});
            put32(interface, 0);
        }
        put_block(out, 1, interface);
        return out;
    }

    Octets record(bool pcapng, const Frame& f) const {
        Octets out, body;
        const auto unit_ns = nanoseconds_ ? 1 : 1000;
        if (!pcapng) {
            put32(out, static_cast<std::uint64_t>(f.t_ns / 1'000'000'000));
            put32(out, static_cast<std::uint64_t>(f.t_ns % 1'000'000'000 / unit_ns));
            put32(out, f.bytes.size()), put32(out, f.length);
            append(out, f.bytes);
            return out;
        }
        const auto ticks = static_cast<std::uint64_t>(f.t_ns / unit_ns);
        put32(body, 0), put32(body, ticks >> 32), put32(body, ticks);
        put32(body, f.bytes.size()), put32(body, f.length);
        append(body, f.bytes);
        put_block(out, 6, body);
        return out;
    }

    /// Writes the file; cut: only the frames before the cut remain.
    void write(bool pcapng, bool cut, GeneratedCapture& out) {
        out.file = header(pcapng);
        const std::size_t whole = cut ? below(frames_.size()) : frames_.size();
        for (std::size_t i = 0; i < whole; ++i) append(out.file, record(pcapng, frames_[i]));
        if (!cut) return;
        Octets last = record(pcapng, frames_[whole]);
        last.resize(1 + below(last.size() - 1));
        append(out.file, last);
        frames_.resize(whole);
        out.is_cut = true;
    }

    void expect(GeneratedCapture& out) const {
        out.is_plain = is_plain_ && !out.is_cut;
        out.counters.frames = frames_.size();
        for (const Frame& f : frames_) {
            if (f.datagram < 0)
                ++out.counters.other;
            else if (!f.is_whole())
                ++(f.bytes.size() < f.length ? out.counters.cut : out.counters.malformed);
        }
        for (std::size_t d = 0; d < sent_.size(); ++d) expect(static_cast<int>(d), out);
        std::ranges::stable_sort(out.datagrams, {}, &UdpDatagram::t_ns);
    }

    void expect(int d, GeneratedCapture& out) const {
        const Sent& sent = sent_[static_cast<std::size_t>(d)];
        std::vector<std::size_t> copies(sent.parts);
        std::int64_t first_ns = INT64_MAX;
        for (const Frame& f : frames_)
            if (f.datagram == d && f.is_whole())
                ++copies[static_cast<std::size_t>(f.part)], first_ns = std::min(first_ns, f.t_ns);
        for (const std::size_t n : copies) out.counters.repeated += n > 1 ? n - 1 : 0;
        const auto missing = static_cast<std::size_t>(std::ranges::count(copies, 0u));
        if (missing == 0) {
            out.datagrams.push_back(sent.datagram);
            out.datagrams.back().t_ns = first_ns;
        } else if (missing < sent.parts) {
            ++out.counters.incomplete;
        }
    }

    std::mt19937 random_;
    int link_ = 1;
    bool big_endian_ = false, constant_id_ = false, nanoseconds_ = false, is_plain_ = true;
    std::size_t id_ = 7;
    std::uint8_t unit_ = 0;
    std::vector<std::pair<std::size_t, std::size_t>> tags_;  ///< EtherType, identifier
    std::int64_t t_ns_ = 1'767'225'600'000'000'000;
    std::vector<Frame> frames_;
    std::vector<Sent> sent_;
};

}  // namespace

GeneratedCapture generated_capture(unsigned seed) {
    return Generator(seed).make();
}

}  // namespace narpa::test
