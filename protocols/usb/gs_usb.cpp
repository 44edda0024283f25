#include "protocols/usb/gs_usb.h"

#include <algorithm>
#include <cstdlib>
#include <initializer_list>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

// Flags in the identifier, as in SocketCAN.
constexpr std::uint32_t kGsExtended = 0x8000'0000, kGsRemote = 0x4000'0000, kGsError = 0x2000'0000;
constexpr std::uint32_t kGsExtendedMask = 0x1fff'ffff, kGsStandardMask = 0x7ff;
// Flags of a frame.
constexpr std::uint8_t kGsOverflow = 1, kGsFd = 2, kGsBitRateSwitch = 4, kGsErrorState = 8;
constexpr std::size_t kGsHeaderBytes = 12, kGsTimeBytes = 4;
constexpr std::array<std::uint8_t, 16> kGsLengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

std::uint8_t gs_length_code(std::uint8_t size) noexcept {
    return static_cast<std::uint8_t>(std::lower_bound(kGsLengths.begin(), kGsLengths.end() - 1, size) -
                                     kGsLengths.begin());
}

void gs_put_words(std::uint8_t* at, std::initializer_list<std::uint32_t> words) noexcept {
    for (const std::uint32_t w : words) put_le(at, w), at += 4;
}

void put_range(std::uint8_t* at, const BitTimingRange& r) noexcept {
    gs_put_words(at,
                 {r.tseg1_min, r.tseg1_max, r.tseg2_min, r.tseg2_max, r.sjw_max, r.brp_min, r.brp_max, r.brp_step});
}

BitTimingRange get_range(const std::uint8_t* at) noexcept {
    const auto word = [&](int i) { return get_le<std::uint32_t>(at + 4 * i); };
    return {word(0), word(1), word(2), word(3), word(4), word(5), word(6), word(7)};
}

/// Above the limits of all controllers; larger numbers are refused.
constexpr std::uint32_t kMaxQuanta = 1024, kMaxPrescaler = 65536;

bool is_sound(const BitTimingRange& r) noexcept {
    return r.tseg1_min >= 1 && r.tseg1_min <= r.tseg1_max && r.tseg1_max <= kMaxQuanta && r.tseg2_min >= 1 &&
           r.tseg2_min <= r.tseg2_max && r.tseg2_max <= kMaxQuanta && r.sjw_max >= 1 && r.sjw_max <= kMaxQuanta &&
           r.brp_min >= 1 && r.brp_min <= r.brp_max && r.brp_max <= kMaxPrescaler && r.brp_step >= 1;
}

}  // namespace

std::array<std::uint8_t, kGsUsbConfigBytes> encode_gs_usb_config(const GsUsbConfig& c) noexcept {
    std::array<std::uint8_t, kGsUsbConfigBytes> b{};
    b[3] = static_cast<std::uint8_t>(c.channels - 1);
    gs_put_words(&b[4], {c.software, c.hardware});
    return b;
}

std::optional<GsUsbConfig> decode_gs_usb_config(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kGsUsbConfigBytes || b[3] == 0xff) return std::nullopt;
    return GsUsbConfig{static_cast<std::uint8_t>(b[3] + 1), get_le<std::uint32_t>(&b[4]),
                       get_le<std::uint32_t>(&b[8])};
}

std::size_t encode_gs_usb_limits(const GsUsbLimits& l, std::span<std::uint8_t, kGsUsbLimitsFdBytes> out) noexcept {
    gs_put_words(&out[0], {l.features, l.clock_hz});
    put_range(&out[8], l.nominal);
    if (!l.data) return kGsUsbLimitsBytes;
    put_range(&out[40], *l.data);
    return kGsUsbLimitsFdBytes;
}

std::optional<GsUsbLimits> decode_gs_usb_limits(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kGsUsbLimitsBytes && b.size() != kGsUsbLimitsFdBytes) return std::nullopt;
    GsUsbLimits l{get_le<std::uint32_t>(&b[0]), get_le<std::uint32_t>(&b[4]), get_range(&b[8])};
    if (b.size() == kGsUsbLimitsFdBytes) l.data = get_range(&b[40]);
    if (l.clock_hz == 0 || !is_sound(l.nominal) || (l.data && !is_sound(*l.data))) return std::nullopt;
    return l;
}

std::array<std::uint8_t, kGsUsbBitTimingBytes> encode_gs_usb_bit_timing(const BitTiming& t) noexcept {
    std::array<std::uint8_t, kGsUsbBitTimingBytes> b{};
    gs_put_words(b.data(), {t.prop_seg, t.phase_seg1, t.phase_seg2, t.sjw, t.brp});
    return b;
}

std::optional<BitTiming> decode_gs_usb_bit_timing(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kGsUsbBitTimingBytes) return std::nullopt;
    const auto word = [&](std::size_t i) { return get_le<std::uint32_t>(&b[4 * i]); };
    const BitTiming t{word(0), word(1), word(2), word(3), word(4)};
    for (const std::uint32_t segment : {t.prop_seg, t.phase_seg1, t.phase_seg2, t.sjw})
        if (segment > kMaxQuanta) return std::nullopt;
    if (t.brp == 0 || t.brp > kMaxPrescaler || t.phase_seg2 == 0 || t.prop_seg + t.phase_seg1 == 0)
        return std::nullopt;
    return t;
}

std::optional<BitTiming> bit_timing_of(std::uint32_t bit_rate, std::uint32_t clock_hz,
                                       const BitTimingRange& r) noexcept {
    if (bit_rate == 0) return std::nullopt;
    const int wanted = bit_rate > 800'000 ? 750 : bit_rate > 500'000 ? 800 : 875;  // per mille of a bit
    std::optional<BitTiming> best;
    int best_error = 1000;
    for (std::uint64_t brp = r.brp_min; brp <= r.brp_max; brp += r.brp_step) {
        const std::uint64_t per_bit = brp * bit_rate, quanta = clock_hz / per_bit;
        if (quanta < 1 + r.tseg1_min + r.tseg2_min) break;
        if (clock_hz % per_bit != 0 || quanta > 1 + r.tseg1_max + r.tseg2_max) continue;
        const auto n = static_cast<std::uint32_t>(quanta);
        const std::uint32_t least = std::max(r.tseg2_min, n - 1 > r.tseg1_max ? n - 1 - r.tseg1_max : 0);
        const std::uint32_t most = std::min(r.tseg2_max, n - 1 - r.tseg1_min);
        if (least > most) continue;
        for (std::uint32_t tseg2 = least; tseg2 <= most; ++tseg2) {
            const int error = std::abs(static_cast<int>(1000 * (n - tseg2) / n) - wanted);
            if (error >= best_error) continue;
            const std::uint32_t tseg1 = n - 1 - tseg2, prop = tseg1 / 2;
            best = BitTiming{prop, tseg1 - prop, tseg2, std::clamp<std::uint32_t>(tseg2 / 2, 1, r.sjw_max),
                             static_cast<std::uint32_t>(brp)};
            best_error = error;
        }
    }
    return best;
}

std::array<std::uint8_t, kGsUsbModeBytes> encode_gs_usb_mode(const GsUsbMode& m) noexcept {
    std::array<std::uint8_t, kGsUsbModeBytes> b{};
    gs_put_words(b.data(), {std::uint32_t{m.start}, m.features});
    return b;
}

std::optional<GsUsbMode> decode_gs_usb_mode(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kGsUsbModeBytes || get_le<std::uint32_t>(&b[0]) > 1) return std::nullopt;
    return GsUsbMode{get_le<std::uint32_t>(&b[0]) == 1, get_le<std::uint32_t>(&b[4])};
}

std::size_t encode_gs_usb_frame(const GsUsbFrame& f, bool with_time,
                                std::span<std::uint8_t, kGsUsbFrameMostBytes> out) noexcept {
    const CanFrame& c = f.frame;
    std::fill(out.begin(), out.end(), std::uint8_t{0});
    put_le(&out[0], f.echo);
    put_le(&out[4], c.id | (c.extended ? kGsExtended : 0) | (c.remote ? kGsRemote : 0) | (c.error ? kGsError : 0));
    out[8] = gs_length_code(c.size);
    out[9] = f.channel;
    out[10] = static_cast<std::uint8_t>((f.overflow ? kGsOverflow : 0) | (c.fd ? kGsFd : 0) |
                                        (c.fd && c.bit_rate_switch ? kGsBitRateSwitch : 0) |
                                        (c.fd && f.error_state ? kGsErrorState : 0));
    const std::size_t room = c.fd ? 64 : 8, size = std::min<std::size_t>(c.size, room);
    if (!c.remote) std::copy_n(c.data.begin(), size, &out[kGsHeaderBytes]);
    if (with_time) put_le(&out[kGsHeaderBytes + room], f.time_us);
    return kGsHeaderBytes + room + (with_time ? kGsTimeBytes : 0);
}

std::optional<GsUsbFrame> decode_gs_usb_frame(std::span<const std::uint8_t> b, bool with_time) noexcept {
    if (b.size() < kGsHeaderBytes) return std::nullopt;
    GsUsbFrame f;
    CanFrame& c = f.frame;
    f.echo = get_le<std::uint32_t>(&b[0]);
    const std::uint32_t id = get_le<std::uint32_t>(&b[4]);
    f.channel = b[9];
    f.overflow = (b[10] & kGsOverflow) != 0;
    c.fd = (b[10] & kGsFd) != 0;
    c.bit_rate_switch = c.fd && (b[10] & kGsBitRateSwitch) != 0;
    f.error_state = c.fd && (b[10] & kGsErrorState) != 0;
    c.error = (id & kGsError) != 0;
    c.extended = !c.error && (id & kGsExtended) != 0;
    c.remote = !c.error && (id & kGsRemote) != 0;
    c.id = id & (c.extended || c.error ? kGsExtendedMask : kGsStandardMask);
    const std::size_t room = c.fd ? 64 : 8;
    const std::size_t least = kGsHeaderBytes + room + (with_time ? kGsTimeBytes : 0);
    if (b.size() < least || b.size() > kGsUsbFrameMostBytes) return std::nullopt;
    if (b[8] > (c.fd ? 15 : 8) || (c.fd && (c.remote || c.error))) return std::nullopt;
    c.size = kGsLengths[b[8]];
    if (!c.remote) std::copy_n(&b[kGsHeaderBytes], c.size, c.data.begin());
    if (with_time) f.time_us = get_le<std::uint32_t>(&b[kGsHeaderBytes + room]);
    return f;
}

}  // namespace narpa
