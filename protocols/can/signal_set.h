/// protocols/can/signal_set.h - encodes and decodes any set of signals.h. No allocation, no sockets.
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <span>
#include <string_view>

#include "protocols/can/frame.h"
#include "protocols/can/signals.h"

namespace narpa {

/// The result of decoding one frame.
enum class DecodeStatus : std::uint8_t {
    not_mine,      ///< another identifier, or a controller's error report
    partial,       ///< a valid part of a set that is not complete yet
    complete,      ///< this frame completes the set
    too_short,     ///< fewer bytes than the message has
    too_long,      ///< more bytes than the message has
    wrong_kind,    ///< right identifier, but remote, 29-bit, or the wrong one of classic and FD
    bad_checksum,  ///< CRC-8 or CRC-16 differs
    duplicate,     ///< same counter and content as a part already seen, or as the last whole set within kRepeat_ns
    incomplete_set,  ///< counted only: an earlier set was dropped because this frame belongs to another one
    not_a_number,    ///< the set is complete, but a signal is "not available" or an unknown choice
    not_unit,        ///< the set is complete, but its quaternion's norm differs from 1 by more than 1e-3
};
inline constexpr std::size_t kDecodeStatusCount = 11;

/// "bad_checksum" and so on.
[[nodiscard]] std::string_view name(DecodeStatus status) noexcept;

inline constexpr std::size_t kMaxSignals = 24;
/// "Not available" among raw values, whatever the length of the field that it came from.
inline constexpr std::int64_t kNotAvailable = std::numeric_limits<std::int64_t>::min();
/// Raw values in the order of the layout's signals.
using RawSignals = std::array<std::int64_t, kMaxSignals>;

/// The frames of one message.
class FrameSet {
public:
    FrameSet() = default;
    explicit FrameSet(const CanFrame& frame) noexcept { push(frame); }
    void push(const CanFrame& frame) noexcept { frames_[size_++] = frame; }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] auto begin() const noexcept { return frames_.begin(); }
    [[nodiscard]] auto end() const noexcept { return frames_.begin() + static_cast<std::ptrdiff_t>(size_); }
    [[nodiscard]] auto begin() noexcept { return frames_.begin(); }
    [[nodiscard]] auto end() noexcept { return frames_.begin() + static_cast<std::ptrdiff_t>(size_); }
    [[nodiscard]] const CanFrame& operator[](std::size_t i) const noexcept { return frames_[i]; }
    [[nodiscard]] CanFrame& operator[](std::size_t i) noexcept { return frames_[i]; }

private:
    std::array<CanFrame, 10> frames_{};
    std::size_t size_ = 0;
};

/// The classic form. Raw values are within the signal's range for classic CAN (or "not available").
[[nodiscard]] FrameSet encode_classic(const SetLayout& layout, const RawSignals& raw, std::uint8_t counter,
                                      std::uint32_t base_id) noexcept;
/// The one frame of the FD form.
[[nodiscard]] CanFrame encode_fd(const SetLayout& layout, const RawSignals& raw, std::uint8_t counter,
                                 std::uint32_t base_id) noexcept;

/// A set with the counter and content of the last one is a repeat of it within this time of reception, and a new
/// one afterwards: a sender that was restarted begins with the same counter.
inline constexpr std::int64_t kRepeat_ns = 100'000'000;

/// Collects the frames of one set. A set takes effect when all its classic frames of one counter have arrived, in
/// any order, or with its one FD frame. A frame with another counter (or other content under the same counter)
/// drops the frames collected so far, which is counted as `incomplete_set`, and starts a new set. Frames that
/// repeat the last whole set are duplicates, but are collected too: in a new set with the old counter some may be
/// equal.
class SetDecoder {
public:
    /// Checks a complete set: `complete`, `not_a_number` or `not_unit`.
    using Verdict = DecodeStatus (*)(const RawSignals&) noexcept;

    SetDecoder(const SetLayout& layout, std::uint32_t base_id, Verdict verdict) noexcept
        : layout_(&layout), base_id_(base_id), verdict_(verdict) {}

    /// `t_ns`: when it was received, on any clock.
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_ns) noexcept;

    /// The newest complete set; meaningful once `accept` has returned complete.
    [[nodiscard]] const RawSignals& raw() const noexcept { return whole_.raw; }
    [[nodiscard]] std::uint8_t counter() const noexcept { return whole_.counter; }
    [[nodiscard]] std::uint32_t base_id() const noexcept { return base_id_; }
    /// How often each status occurred (for incomplete_set: how many sets were dropped).
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept {
        return counts_[static_cast<std::size_t>(status)];
    }

private:
    struct Set {
        RawSignals raw{};
        std::uint32_t seen = 0;  ///< bit i: classic frame i has arrived
        std::uint8_t counter = 0;
    };

    [[nodiscard]] DecodeStatus judge(const CanFrame& frame, std::int64_t t_ns) noexcept;
    [[nodiscard]] DecodeStatus take_classic(const CanFrame& frame, std::size_t index, std::int64_t t_ns) noexcept;
    [[nodiscard]] DecodeStatus take_fd(const CanFrame& frame, std::int64_t t_ns) noexcept;
    [[nodiscard]] DecodeStatus conclude(const Set& set, std::int64_t t_ns) noexcept;
    /// A set with this counter may be a repeat of the last whole one.
    [[nodiscard]] bool may_repeat(std::uint8_t counter, std::int64_t t_ns) const noexcept {
        return has_whole_ && counter == whole_.counter && std::abs(t_ns - t_whole_ns_) <= kRepeat_ns;
    }
    void drop_partial() noexcept;

    const SetLayout* layout_;
    std::uint32_t base_id_;
    Verdict verdict_;
    Set partial_{}, whole_{};
    bool has_whole_ = false;
    bool repeats_ = false;         ///< all frames of partial_ are as in whole_
    std::int64_t t_whole_ns_ = 0;  ///< when whole_ or its last repeat was completed
    std::array<std::uint64_t, kDecodeStatusCount> counts_{};
};

/// The 64-bit time nearest to `t_reference` whose low `bits` bits are `wrapped` (serial number arithmetic as in
/// RFC 1982: the result is less than half a period ahead of the reference, or at most half a period behind).
[[nodiscard]] constexpr std::int64_t unwrap_time(std::uint64_t wrapped, int bits,
                                                 std::int64_t t_reference) noexcept {
    const std::uint64_t difference = (wrapped - static_cast<std::uint64_t>(t_reference)) << (64 - bits);
    return static_cast<std::int64_t>(
        static_cast<std::uint64_t>(t_reference) +
        static_cast<std::uint64_t>(static_cast<std::int64_t>(difference) >> (64 - bits)));
}

}  // namespace narpa
