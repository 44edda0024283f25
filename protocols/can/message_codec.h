/// protocols/can/message_codec.h - messages.h's templates. Included only by the files that specialise Codec.
#pragma once

#include "protocols/can/messages.h"
#include "protocols/can/signal_values.h"

namespace narpa {

/// How a message becomes raw signals and back. A specialisation has:
///   layout                                       its SetLayout
///   base_id(camera)                              of a message of this camera
///   camera(message), counter(message)
///   raw_of(message)                              -> RawSignals
///   check(raw)                                   -> complete, not_a_number or not_unit
///   read(raw, counter, t_reference_ns, message)  of signals that passed the check
template <class Message>
struct Codec;

template <class Message>
FrameSet encode_classic(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_classic(C::layout, C::raw_of(m), C::counter(m), C::base_id(C::camera(m)));
}

template <class Message>
CanFrame encode_fd(const Message& m) noexcept {
    using C = Codec<Message>;
    return encode_fd(C::layout, C::raw_of(m), C::counter(m), C::base_id(C::camera(m)));
}

template <class Message>
MessageDecoder<Message>::MessageDecoder(std::uint8_t camera) noexcept
    : set_(Codec<Message>::layout, Codec<Message>::base_id(camera), Codec<Message>::check) {}

template <class Message>
DecodeStatus MessageDecoder<Message>::accept(const CanFrame& frame, std::int64_t t_reference_ns,
                                             Message& out) noexcept {
    const DecodeStatus status = set_.accept(frame);
    if (status == DecodeStatus::complete) Codec<Message>::read(set_.raw(), set_.counter(), t_reference_ns, out);
    return status;
}

/// Every choice is a known one.
[[nodiscard]] inline bool has_known_choices(const RawSignals& raw, SignalTable signals) noexcept {
    for (std::size_t i = 0; i < signals.size(); ++i)
        if (!signals[i].choices.empty() && raw[i] >= static_cast<std::int64_t>(signals[i].choices.size()))
            return false;
    return true;
}

[[nodiscard]] inline std::int64_t time_of(std::int64_t raw, std::int64_t t_reference_ns) noexcept {
    return unwrap_time(static_cast<std::uint64_t>(raw), kTimeBits, t_reference_ns);
}

}  // namespace narpa

#define NARPA_CAN_MESSAGE(Message)                             \
    template FrameSet encode_classic(const Message&) noexcept; \
    template CanFrame encode_fd(const Message&) noexcept;      \
    template class MessageDecoder<Message>
