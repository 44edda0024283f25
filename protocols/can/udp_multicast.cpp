#include "protocols/can/udp_multicast.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "protocols/can/hex.h"

namespace narpa {
namespace {

/// The keys in the order that python-can writes them.
enum Key : std::size_t {
    kTimestamp,
    kId,
    kExtended,
    kRemote,
    kError,
    kChannel,
    kDlc,
    kData,
    kFd,
    kBitRateSwitch,
    kErrorState,
    kKeyCount
};
// msgpack is written by hand: nlohmann::json and msgpack-cxx build a tree on the heap for each datagram, and the
// loop, which sends and receives here, must not allocate. One flat map with eleven known keys needs no tree.
constexpr std::array<std::string_view, kKeyCount> kKeys{
    "timestamp", "arbitration_id", "is_extended_id", "is_remote_frame", "is_error_frame",       "channel",
    "dlc",       "data",           "is_fd",          "bitrate_switch",  "error_state_indicator"};

// msgpack type bytes (msgpack specification, "Formats").
constexpr std::uint8_t kNil = 0xC0, kFalse = 0xC2, kTrue = 0xC3, kBin8 = 0xC4, kBin16 = 0xC5, kBin32 = 0xC6,
                       kFloat32 = 0xCA, kFloat64 = 0xCB, kUint8 = 0xCC, kUint16 = 0xCD, kUint32 = 0xCE,
                       kUint64 = 0xCF, kStr8 = 0xD9, kStr16 = 0xDA, kMap16 = 0xDE, kFixMap = 0x80, kFixStr = 0xA0;

class Writer {
public:
    explicit Writer(std::uint8_t* p) : start_(p), p_(p) {}
    void byte(std::uint8_t b) { *p_++ = b; }
    void bytes(std::span<const std::uint8_t> data) { p_ = std::copy(data.begin(), data.end(), p_); }
    void key(Key k) {
        byte(static_cast<std::uint8_t>(kFixStr | kKeys[k].size()));
        p_ = std::copy(kKeys[k].begin(), kKeys[k].end(), p_);
    }
    void boolean(Key k, bool value) {
        key(k);
        byte(value ? kTrue : kFalse);
    }
    void unsigned_integer(Key k, std::uint32_t value) {
        key(k);
        const int n = value < 0x80 ? 0 : value <= 0xFF ? 1 : value <= 0xFFFF ? 2 : 4;
        if (n > 0) byte(n == 1 ? kUint8 : n == 2 ? kUint16 : kUint32);
        for (int shift = 8 * (n > 0 ? n - 1 : 0); shift >= 0; shift -= 8)
            byte(static_cast<std::uint8_t>(value >> shift));
    }
    [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(p_ - start_); }

private:
    std::uint8_t *start_, *p_;
};

/// Each function reads one value of its type from the front. After another type or the end of the bytes the reader
/// has failed, and values are empty.
class Reader {
public:
    explicit Reader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
    [[nodiscard]] bool empty() const { return rest_.empty(); }
    [[nodiscard]] bool failed() const { return failed_; }

    std::uint64_t map_size() {
        const std::uint8_t type = byte();
        return (type & 0xF0) == kFixMap ? type & 0x0F : type == kMap16 ? big_endian(2) : fail();
    }
    std::string_view string() {
        const std::uint8_t type = byte();
        const auto text = take((type & 0xE0) == kFixStr ? type & 0x1F
                               : type == kStr8          ? big_endian(1)
                               : type == kStr16         ? big_endian(2)
                                                        : fail());
        return {reinterpret_cast<const char*>(text.data()), text.size()};
    }
    bool boolean() {
        const std::uint8_t type = byte();
        if (type != kTrue && type != kFalse) fail();
        return type == kTrue;
    }
    std::uint64_t unsigned_integer() {
        const std::uint8_t type = byte();
        if (type < 0x80) return type;
        return type >= kUint8 && type <= kUint64 ? big_endian(std::size_t{1} << (type - kUint8)) : fail();
    }
    std::span<const std::uint8_t> binary() {
        const std::uint8_t type = byte();
        return take(type >= kBin8 && type <= kBin32 ? big_endian(std::size_t{1} << (type - kBin8)) : fail());
    }
    /// A time stamp or a channel: not used, but it must be well formed.
    void skip_number_or_text() {
        const std::uint8_t type = rest_.empty() ? kNil : rest_.front();
        if (type == kNil || type == kFloat32 || type == kFloat64)
            take(type == kNil ? 1 : type == kFloat32 ? 5 : 9);
        else if (type < 0x80 || (type >= kUint8 && type <= kUint64))
            unsigned_integer();
        else
            (void)string();
    }

private:
    std::uint64_t fail() {
        failed_ = true;
        return 0;
    }
    std::span<const std::uint8_t> take(std::uint64_t n) {
        if (n > rest_.size()) n = fail();
        const auto front = rest_.first(static_cast<std::size_t>(n));
        rest_ = rest_.subspan(static_cast<std::size_t>(n));
        return front;
    }
    std::uint64_t big_endian(std::size_t n) {
        std::uint64_t value = 0;
        for (const std::uint8_t b : take(n)) value = value << 8 | b;
        return value;
    }
    std::uint8_t byte() { return static_cast<std::uint8_t>(big_endian(1)); }

    std::span<const std::uint8_t> rest_;
    bool failed_ = false;
};

bool valid(const CanFrame& frame) {
    if (frame.id > (frame.extended ? kMaxExtendedId : kMaxStandardId)) return false;
    if (frame.fd && (frame.remote || frame.error)) return false;
    return (frame.fd || !frame.bit_rate_switch) && frame.size <= (frame.fd ? 64 : 8);
}

}  // namespace

std::size_t encode_udp_multicast(const CanFrame& frame,
                                 std::span<std::uint8_t, kUdpMulticastMaxBytes> out) noexcept {
    Writer w(out.data());
    const auto data = frame.remote ? std::span<const std::uint8_t>{} : frame.payload();
    w.byte(kFixMap | kKeyCount);
    w.key(kTimestamp);
    w.byte(kFloat64);
    w.bytes(std::array<std::uint8_t, 8>{});  // the receiver stamps it
    w.unsigned_integer(kId, frame.id);
    w.boolean(kExtended, frame.extended);
    w.boolean(kRemote, frame.remote);
    w.boolean(kError, frame.error);
    w.key(kChannel);
    w.byte(kNil);
    w.unsigned_integer(kDlc, frame.size);
    w.key(kData);
    w.byte(kBin8);
    w.byte(static_cast<std::uint8_t>(data.size()));
    w.bytes(data);
    w.boolean(kFd, frame.fd);
    w.boolean(kBitRateSwitch, frame.bit_rate_switch);
    w.boolean(kErrorState, false);
    return w.size();
}

bool decode_udp_multicast(std::span<const std::uint8_t> datagram, CanFrame& out) noexcept {
    Reader r(datagram);
    const std::uint64_t entries = r.map_size();
    if (r.failed() || entries > kKeyCount) return false;
    CanFrame frame;
    frame.extended = true;
    std::uint32_t seen = 0;
    std::uint64_t dlc = 0;
    std::span<const std::uint8_t> data;
    for (std::uint64_t i = 0; i < entries; ++i) {
        const std::string_view text = r.string();
        const auto k = static_cast<std::size_t>(std::find(kKeys.begin(), kKeys.end(), text) - kKeys.begin());
        if (k == kKeyCount || (seen & (1u << k)) != 0) return false;
        seen |= 1u << k;
        switch (k) {
            case kTimestamp:
            case kChannel: r.skip_number_or_text(); break;
            case kId:
            case kDlc: {
                const std::uint64_t value = r.unsigned_integer();
                if (value > kMaxExtendedId) return false;
                if (k == kId)
                    frame.id = static_cast<std::uint32_t>(value);
                else
                    dlc = value;
                break;
            }
            case kData: data = r.binary(); break;
            case kExtended: frame.extended = r.boolean(); break;
            case kRemote: frame.remote = r.boolean(); break;
            case kError: frame.error = r.boolean(); break;
            case kFd: frame.fd = r.boolean(); break;
            case kBitRateSwitch: frame.bit_rate_switch = r.boolean(); break;
            default: (void)r.boolean();
        }
        if (r.failed()) return false;
    }
    if (!r.empty() || (seen & (1u << kId)) == 0) return false;
    if ((seen & (1u << kDlc)) == 0) dlc = data.size();
    if (data.size() != (frame.remote ? 0 : dlc) || dlc > 64) return false;
    frame.size = static_cast<std::uint8_t>(dlc);
    if (!valid(frame)) return false;
    std::copy(data.begin(), data.end(), frame.data.begin());
    out = frame;
    return true;
}

}  // namespace narpa
