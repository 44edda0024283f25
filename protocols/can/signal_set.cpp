#include "protocols/can/signal_set.h"

#include <cassert>
#include <utility>

#include "protocols/can/crc.h"

namespace narpa {
namespace {

void put_bits(std::span<std::uint8_t> bytes, int start, int length, std::uint64_t value) noexcept {
    for (int done = 0; done < length;) {
        const int bit = (start + done) % 8, n = length - done < 8 - bit ? length - done : 8 - bit;
        const unsigned mask = ((1u << n) - 1u) << bit;
        std::uint8_t& byte = bytes[static_cast<std::size_t>((start + done) / 8)];
        byte = static_cast<std::uint8_t>((byte & ~mask) | (static_cast<unsigned>(value >> done) << bit & mask));
        done += n;
    }
}

std::uint64_t get_bits(std::span<const std::uint8_t> bytes, int start, int length) noexcept {
    std::uint64_t value = 0;
    for (int done = 0; done < length;) {
        const int bit = (start + done) % 8, n = length - done < 8 - bit ? length - done : 8 - bit;
        const std::uint64_t part = (bytes[static_cast<std::size_t>((start + done) / 8)] >> bit) & ((1u << n) - 1u);
        value |= part << done;
        done += n;
    }
    return value;
}

/// The raw value of a signal; "not available" in a field of any length is kNotAvailable, so that both forms of a
/// set give the same raw values.
std::int64_t get_signal(std::span<const std::uint8_t> bytes, const Signal& signal, const BitField& at) noexcept {
    const std::uint64_t bits = get_bits(bytes, at.start_bit, at.length);
    if (!signal.is_signed) return static_cast<std::int64_t>(bits);
    const int shift = 64 - at.length;
    const std::int64_t raw = static_cast<std::int64_t>(bits << shift) >> shift;
    return raw == raw_not_available(at.length) ? kNotAvailable : raw;
}

void put_signal(std::span<std::uint8_t> bytes, const BitField& at, std::int64_t raw) noexcept {
    if (raw == kNotAvailable) raw = raw_not_available(at.length);
    put_bits(bytes, at.start_bit, at.length, static_cast<std::uint64_t>(raw));
}

std::array<std::uint8_t, 2> id_bytes(std::uint32_t id) noexcept {
    return {static_cast<std::uint8_t>(id & 0xFF), static_cast<std::uint8_t>(id >> 8)};
}

std::uint8_t classic_crc(const CanFrame& frame) noexcept {
    return crc8_j1850(std::span(frame.data).first(kClassicCrcByte), crc8_j1850(id_bytes(frame.id)));
}

std::uint16_t fd_crc(const CanFrame& frame) noexcept {
    return crc16_ccitt_false(std::span(frame.data).first(kFdCrcByte), crc16_ccitt_false(id_bytes(frame.id)));
}

}  // namespace

std::string_view name(DecodeStatus status) noexcept {
    constexpr std::array<std::string_view, kDecodeStatusCount> names{
        "not_mine",     "partial",   "complete",       "too_short",    "too_long", "wrong_kind",
        "bad_checksum", "duplicate", "incomplete_set", "not_a_number", "not_unit"};
    return names[static_cast<std::size_t>(status)];
}

FrameSet encode_classic(const SetLayout& layout, const RawSignals& raw, std::uint8_t counter,
                        std::uint32_t base_id) noexcept {
    FrameSet set;
    for (std::size_t index = 0; index < layout.frames.size(); ++index) {
        CanFrame frame;
        frame.id = base_id + static_cast<std::uint32_t>(index);
        frame.size = kClassicBytes;
        for (std::size_t i = 0; i < layout.signals.size(); ++i)
            if (layout.signals[i].classic.frame == index) put_signal(frame.data, layout.signals[i].classic, raw[i]);
        frame.data[kClassicCounterByte] = counter;
        frame.data[kClassicCrcByte] = classic_crc(frame);
        set.push(frame);
    }
    return set;
}

CanFrame encode_fd(const SetLayout& layout, const RawSignals& raw, std::uint8_t counter,
                   std::uint32_t base_id) noexcept {
    assert(layout.fd_counter_bit != 0 && "the message has a CAN FD form");
    CanFrame frame;
    frame.id = base_id + kFdOffset;
    frame.fd = frame.bit_rate_switch = true;
    frame.size = kFdBytes;
    for (std::size_t i = 0; i < layout.signals.size(); ++i) put_signal(frame.data, layout.signals[i].fd, raw[i]);
    put_bits(frame.data, layout.fd_counter_bit, 8, counter);
    put_bits(frame.data, 8 * kFdCrcByte, 16, fd_crc(frame));
    return frame;
}

DecodeStatus SetDecoder::accept(const CanFrame& frame, std::int64_t t_ns) noexcept {
    const DecodeStatus status = judge(frame, t_ns);
    ++counts_[static_cast<std::size_t>(status)];
    return status;
}

DecodeStatus SetDecoder::judge(const CanFrame& frame, std::int64_t t_ns) noexcept {
    const std::uint32_t index = frame.id - base_id_;
    const bool has_fd = layout_->fd_counter_bit != 0;
    const bool is_classic_id = index < layout_->frames.size(), is_fd_id = has_fd && index == kFdOffset;
    if (frame.error || !(is_classic_id || is_fd_id)) return DecodeStatus::not_mine;
    if (frame.extended || frame.remote || frame.fd != is_fd_id) return DecodeStatus::wrong_kind;
    const std::size_t expected = is_fd_id ? kFdBytes : kClassicBytes;
    if (frame.size < expected) return DecodeStatus::too_short;
    if (frame.size > expected) return DecodeStatus::too_long;
    if (is_fd_id) {
        if (get_bits(frame.data, 8 * kFdCrcByte, 16) != fd_crc(frame)) return DecodeStatus::bad_checksum;
        return take_fd(frame, t_ns);
    }
    if (frame.data[kClassicCrcByte] != classic_crc(frame)) return DecodeStatus::bad_checksum;
    return take_classic(frame, index, t_ns);
}

DecodeStatus SetDecoder::take_classic(const CanFrame& frame, std::size_t index, std::int64_t t_ns) noexcept {
    const std::uint8_t counter = frame.data[kClassicCounterByte];
    const std::span<const Signal> signals = layout_->signals;
    RawSignals raw{};
    bool as_partial = true, as_whole = true;  // the same content as in partial_, as in whole_
    for (std::size_t i = 0; i < signals.size(); ++i) {
        if (signals[i].classic.frame != index) continue;
        raw[i] = get_signal(frame.data, signals[i], signals[i].classic);
        as_partial = as_partial && raw[i] == partial_.raw[i];
        as_whole = as_whole && raw[i] == whole_.raw[i];
    }

    const bool may_be_repeat = may_repeat(counter, t_ns);
    if (repeats_ && !may_be_repeat) drop_partial();
    const bool continues = partial_.seen != 0 && counter == partial_.counter;
    const std::uint32_t bit = 1u << index;
    const bool seen = continues && (partial_.seen & bit) != 0;
    if (seen && as_partial) return DecodeStatus::duplicate;
    if (!continues || seen) drop_partial();

    repeats_ = may_be_repeat && as_whole && (partial_.seen == 0 || repeats_);
    partial_.counter = counter;
    partial_.seen |= bit;
    for (std::size_t i = 0; i < signals.size(); ++i)
        if (signals[i].classic.frame == index) partial_.raw[i] = raw[i];
    if (partial_.seen != (1u << layout_->frames.size()) - 1u)
        return repeats_ ? DecodeStatus::duplicate : DecodeStatus::partial;
    const Set set = partial_;
    partial_.seen = 0;
    return conclude(set, t_ns);
}

DecodeStatus SetDecoder::take_fd(const CanFrame& frame, std::int64_t t_ns) noexcept {
    Set set;
    set.counter = static_cast<std::uint8_t>(get_bits(frame.data, layout_->fd_counter_bit, 8));
    for (std::size_t i = 0; i < layout_->signals.size(); ++i)
        set.raw[i] = get_signal(frame.data, layout_->signals[i], layout_->signals[i].fd);
    repeats_ = may_repeat(set.counter, t_ns) && set.raw == whole_.raw;
    if (!repeats_) drop_partial();
    return conclude(set, t_ns);
}

DecodeStatus SetDecoder::conclude(const Set& set, std::int64_t t_ns) noexcept {
    t_whole_ns_ = t_ns;
    if (std::exchange(repeats_, false)) return DecodeStatus::duplicate;
    whole_ = set;
    has_whole_ = true;
    return verdict_(set.raw);
}

void SetDecoder::drop_partial() noexcept {
    if (partial_.seen != 0 && !repeats_) ++counts_[static_cast<std::size_t>(DecodeStatus::incomplete_set)];
    partial_.seen = 0;
    repeats_ = false;
}

}  // namespace narpa
