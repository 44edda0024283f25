/// protocols/can/codec.h - a message's members to the signals of its description and back, on classic CAN and CAN
/// FD.
///
/// A message is a plain struct with a specialisation of Codec: messages/lidar_beam.h is a short one. Nothing here
/// allocates (except texts of errors), blocks or throws.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "base/pose.h"
#include "protocols/can/frame.h"
#include "protocols/can/signal_set.h"

namespace narpa {

/// The specialisation for a message has
///
///     static constexpr const SetLayout& layout;          its description
///     static void fields(auto& m, const auto& each);     calls `each` with its members in the order of the signals
///
/// and, where the message needs them,
///
///     static auto& counter(auto& m);                     in place of m.counter: a number of which it is the low 8
///     bits static std::uint32_t instance(const Message&);     SetLayout::base_id_of static DecodeStatus
///     check(const RawSignals&);      in place of check_signals(layout.signals, raw, false) static void
///     encoded(const Message&, RawSignals&);  changes the signals, e.g. to "not available" static void
///     decoded(const Message& before, Message& out); static auto& addressee(auto& m);                   the first
///     member: read from refused messages too
template <class Message>
struct Codec;

inline constexpr double kUnitTolerance = 1e-3;  ///< of a quaternion's norm

/// The quantity that does not fit the wire; `operator bool` is true if all fit.
struct EncodeStatus {
    std::string_view quantity{};  ///< signal name, or "AttitudeNorm"; empty: all is well
    std::string_view unit{};
    double value = 0, min = 0, max = 0;

    explicit operator bool() const noexcept { return quantity.empty(); }
    /// "VelocityX = 12000 m/s is outside -10737.4 .. 10737.4 m/s".
    [[nodiscard]] std::string text() const;
};

/// Rounds to the nearest microsecond, halves upwards; exact for negative times.
[[nodiscard]] constexpr std::int64_t to_us(std::int64_t t_ns) noexcept {
    const std::int64_t q = t_ns / 1000, r = t_ns % 1000;
    return q + (r >= 500 ? 1 : r < -500 ? -1 : 0);
}

// Times are in ns in messages. On the wire, unsigned signals are the clock's low bits, in ns or us; signed ones in
// us are after the message's first clock signal in ns, and signed ones in ns are durations.

/// Values to raw signals, one after the other: a Vec3 takes three signals, a Quat four (w, x, y, z), a Rigid3
/// seven. Values beyond a signal's range saturate; `overflow` names the first.
class RawWriter {
public:
    /// `form`: &Signal::classic or &Signal::fd, whose lengths limit the values.
    RawWriter(std::span<const Signal> signals, BitField Signal::*form) noexcept : signals_(signals), form_(form) {}

    /// A value that is not finite becomes "not available", in unsigned signals the maximum.
    void put(double value) noexcept {
        const Signal& s = signals_[next()];
        const auto most = static_cast<double>(limit(s)), least = s.is_signed ? -most : 0.0;
        const double scaled = std::round(value * s.steps_per_unit);
        if (!(scaled >= least && scaled <= most) && overflow)
            overflow = {s.name, s.unit, value, least / s.steps_per_unit, most / s.steps_per_unit};
        if (std::isfinite(value))
            push(static_cast<std::int64_t>(std::clamp(scaled, least, most)));
        else
            push(s.is_signed ? kNotAvailable : limit(s));
    }
    /// Negative: not known.
    void put(float value) noexcept {
        const Signal& s = signals_[next()];
        const double steps = static_cast<double>(value) * s.steps_per_unit;
        if (value >= 0)
            push(std::llround(std::min(steps, static_cast<double>(limit(s)))));
        else
            push(s.is_signed ? kNotAvailable : 0);
    }
    void put(std::int64_t t_ns) noexcept {
        const Signal& s = signals_[next()];
        const bool us = s.unit == "us";
        assert((us || s.unit == "ns") && "a member of 64 bits is a time");
        if (!s.is_signed && !us && !first_clock_ns_) first_clock_ns_ = t_ns;
        if (!s.is_signed)
            push((us ? to_us(t_ns) : t_ns) & limit(s));
        else
            push(us ? std::clamp(to_us(t_ns - first_clock_ns_.value_or(0)), -limit(s), limit(s)) : t_ns);
    }
    void put(const Vec3& v) noexcept { put(v.x), put(v.y), put(v.z); }
    void put(const Quat& q) noexcept { put(q.w), put(q.vec()); }
    void put(const Rigid3& T) noexcept { put(T.t), put(T.q); }
    void put(const Motion& m) noexcept { put(m.T_world_body), put(m.velocity_m_s), put(m.rate_rad_s); }
    template <class Value>
    void put(const std::optional<Value>& value) noexcept {
        value ? put(*value) : push(kNotAvailable);
    }
    template <class Whole>
    void put(Whole value) noexcept {
        const std::int64_t most = limit(signals_[next()]);
        push(std::cmp_greater(as_integer(value), most) ? most : static_cast<std::int64_t>(value));
    }

    RawSignals raw{};
    EncodeStatus overflow{};

private:
    static constexpr auto as_integer(auto value) noexcept {
        if constexpr (std::is_integral_v<decltype(value)> && !std::is_same_v<decltype(value), bool>)
            return value;
        else
            return static_cast<int>(value);
    }
    [[nodiscard]] std::int64_t limit(const Signal& s) const noexcept {
        return raw_max(s.is_signed, (s.*form_).length);
    }
    [[nodiscard]] std::size_t next() const noexcept {
        assert(i_ < signals_.size() && "a message has as many fields as signals");
        return i_;
    }
    void push(std::int64_t value) noexcept { raw[i_++] = value; }

    std::span<const Signal> signals_;
    BitField Signal::*form_;
    std::size_t i_ = 0;
    std::optional<std::int64_t> first_clock_ns_{};
};

/// Raw signals to values, in the same order.
class RawReader {
public:
    /// `t_reference_ns` resolves the times: unwrap_time.
    RawReader(std::span<const Signal> signals, const RawSignals& raw, std::int64_t t_reference_ns,
              std::size_t first = 0) noexcept
        : signals_(signals), raw_(raw), t_reference_ns_(t_reference_ns), i_(first) {}

    /// NaN where it is not available.
    void get(double& value) noexcept {
        const auto [s, raw] = next();
        value = raw == kNotAvailable ? std::numeric_limits<double>::quiet_NaN()
                                     : static_cast<double>(raw) / s.steps_per_unit;
    }
    /// Negative where it is not available.
    void get(float& value) noexcept {
        double wide = 0;
        get(wide);
        value = std::isnan(wide) ? -1.0f : static_cast<float>(wide);
    }
    /// 0 where it is not available.
    void get(std::int64_t& t_ns) noexcept {
        const auto [s, raw] = next();
        const int bits = s.classic.length;
        const bool us = s.unit == "us";
        assert((us || s.unit == "ns") && "a member of 64 bits is a time");
        if (s.is_signed) {
            t_ns = raw == kNotAvailable ? 0 : us ? first_clock_ns_.value_or(0) + 1000 * raw : raw;
        } else if (us) {
            t_ns = 1000 * unwrap_time(static_cast<std::uint64_t>(raw), bits, to_us(t_reference_ns_));
        } else {
            t_ns = unwrap_time(static_cast<std::uint64_t>(raw), bits, t_reference_ns_);
            if (!first_clock_ns_) first_clock_ns_ = t_ns;
        }
    }
    void get(Vec3& v) noexcept { get(v.x), get(v.y), get(v.z); }
    void get(Quat& q) noexcept { q = normalized(attitude()); }
    void get(Rigid3& T) noexcept { get(T.t), get(T.q); }
    void get(Motion& m) noexcept { get(m.T_world_body), get(m.velocity_m_s), get(m.rate_rad_s); }
    void get(bool& value) noexcept { value = next().raw != 0; }
    template <class Value>
    void get(std::optional<Value>& value) noexcept {
        value.reset();
        raw_[i_] == kNotAvailable ? void(++i_) : get(value.emplace());
    }
    /// What the member cannot hold becomes its largest value.
    template <class Whole>
    void get(Whole& value) noexcept {
        const std::int64_t raw = next().raw;
        if constexpr (std::is_integral_v<Whole>)
            value = std::in_range<Whole>(raw) ? static_cast<Whole>(raw) : std::numeric_limits<Whole>::max();
        else
            value = static_cast<Whole>(raw);
    }

    /// As received: not normalised.
    [[nodiscard]] Quat attitude() noexcept {
        Quat q;
        get(q.w), get(q.x), get(q.y), get(q.z);
        return q;
    }

private:
    struct Item {
        const Signal& s;
        std::int64_t raw;
    };
    Item next() noexcept {
        assert(i_ < signals_.size() && "a message has as many fields as signals");
        const std::size_t i = i_++;
        return {signals_[i], raw_[i]};
    }

    std::span<const Signal> signals_;
    const RawSignals& raw_;
    std::int64_t t_reference_ns_;
    std::size_t i_;
    std::optional<std::int64_t> first_clock_ns_{};
};

[[nodiscard]] constexpr std::size_t index_of(std::span<const Signal> signals, std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(signals, name, &Signal::name) - signals.begin());
}

/// Refuses unknown choices, quaternions that are no rotation, and (unless `may_lack`) missing quantities.
[[nodiscard]] inline DecodeStatus check_signals(std::span<const Signal> signals, const RawSignals& raw,
                                                bool may_lack) noexcept {
    for (std::size_t i = 0; i < signals.size(); ++i) {
        const bool missing = raw[i] == kNotAvailable;
        const auto choices = static_cast<std::int64_t>(signals[i].choices.size());
        if (missing && !may_lack) return DecodeStatus::not_a_number;
        if (choices > 0 && !missing && (raw[i] < 0 || raw[i] >= choices)) return DecodeStatus::not_a_number;
    }
    const std::size_t at = index_of(signals, "AttitudeW");
    if (may_lack || at == signals.size()) return DecodeStatus::complete;
    const bool is_unit = std::abs(norm(RawReader(signals, raw, 0, at).attitude()) - 1.0) <= kUnitTolerance;
    return is_unit ? DecodeStatus::complete : DecodeStatus::not_unit;
}

/// The signals of a message. `overflow` may be null.
template <class Message>
[[nodiscard]] RawSignals raw_signals(const Message& m, BitField Signal::*form,
                                     EncodeStatus* overflow = nullptr) noexcept {
    using C = Codec<Message>;
    RawWriter writer(C::layout.signals, form);
    C::fields(m, [&](const auto&... values) { (writer.put(values), ...); });
    if constexpr (requires { C::encoded(m, writer.raw); }) C::encoded(m, writer.raw);
    if (overflow) *overflow = writer.overflow;
    return writer.raw;
}

template <class Message>
[[nodiscard]] std::uint32_t base_id_of(const Message& m) noexcept {
    if constexpr (requires { Codec<Message>::instance(m); })
        return Codec<Message>::layout.base_id_of(Codec<Message>::instance(m));
    else
        return Codec<Message>::layout.base_id;
}

template <class Message>
[[nodiscard]] auto& counter_of(Message& m) noexcept {
    using C = Codec<std::remove_const_t<Message>>;
    if constexpr (requires { C::counter(m); })
        return C::counter(m);
    else
        return m.counter;
}

/// The frames of a message.
template <class Message>
[[nodiscard]] FrameSet encode_classic(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_classic(C::layout, raw_signals(m, &Signal::classic), static_cast<std::uint8_t>(counter_of(m)),
                          base_id_of(m));
}
template <class Message>
[[nodiscard]] CanFrame encode_fd(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_fd(C::layout, raw_signals(m, &Signal::fd), static_cast<std::uint8_t>(counter_of(m)),
                     base_id_of(m));
}
/// The form that the bus carries.
template <class Message>
[[nodiscard]] FrameSet encode(const Message& message, bool fd) noexcept {
    return fd ? FrameSet(encode_fd(message)) : encode_classic(message);
}

/// Reads one kind of message, classic or FD. Fixed size.
template <class Message>
class MessageDecoder {
    using C = Codec<Message>;

public:
    /// `which`: of poses the body's can_id, of ledgers the camera (SetLayout::base_id_of).
    explicit MessageDecoder(std::uint32_t which = 0) noexcept
        : set_(C::layout, C::layout.base_id_of(which), check) {}

    /// Writes `out` only when `complete`; of a `not_a_number` message to cameras, counter and camera(s).
    /// `t_reference_ns` (simulation clock) resolves the times: of 48 bits within 39 h. Whether a message is too
    /// late is for the receiver to decide. `incomplete_set` is never returned, only counted: see SetDecoder.
    [[nodiscard]] DecodeStatus accept(const CanFrame& frame, std::int64_t t_reference_ns, Message& out) noexcept {
        const DecodeStatus status = set_.accept(frame, t_reference_ns);
        RawReader reader(C::layout.signals, set_.raw(), t_reference_ns);
        using Counter = std::remove_reference_t<decltype(counter_of(out))>;
        if constexpr (requires { C::addressee(out); })
            if (status == DecodeStatus::not_a_number)
                counter_of(out) = set_.counter(), reader.get(C::addressee(out));
        if (status != DecodeStatus::complete) return status;
        const auto read = [&] {
            counter_of(out) = static_cast<Counter>(set_.counter());  // a frame or cycle number is then read in full
            C::fields(out, [&](auto&... values) { (reader.get(values), ...); });
        };
        if constexpr (requires { C::decoded(out, out); }) {
            const Message before = out;
            read();
            C::decoded(before, out);
        } else {
            read();
        }
        return status;
    }
    [[nodiscard]] std::uint32_t base_id() const noexcept { return set_.base_id(); }
    [[nodiscard]] std::uint64_t count(DecodeStatus status) const noexcept { return set_.count(status); }

private:
    static DecodeStatus check(const RawSignals& raw) noexcept {
        if constexpr (requires { C::check(raw); })
            return C::check(raw);
        else
            return check_signals(C::layout.signals, raw, false);
    }

    SetDecoder set_;
};

}  // namespace narpa
