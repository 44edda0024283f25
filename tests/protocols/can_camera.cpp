// Messages to and from a camera that is operated while it runs: both forms carry the same, and invalid ones are
// refused.
#include <gtest/gtest.h>

#include <random>
#include <utility>
#include <vector>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

class RandomCamera {
public:
    std::int64_t below(std::int64_t limit) {
        return std::uniform_int_distribution<std::int64_t>(0, limit - 1)(rng_);
    }
    template <class Value>
    void maybe(std::optional<Value>& value, std::int64_t limit) {
        value.reset();
        if (below(3) > 0) value = static_cast<Value>(below(limit));
    }
    void fill(CameraCommand& c) {
        c.counter = static_cast<std::uint8_t>(below(256)), c.camera = static_cast<std::uint8_t>(below(256));
        maybe(c.running, 2), maybe(c.trigger, 3), maybe(c.auto_exposure, 2), maybe(c.binning, 128);
        maybe(c.exposure_ns, std::int64_t{1} << 47), maybe(c.period_ns, std::int64_t{1} << 47);
        maybe(c.region_x, 65536), maybe(c.region_y, 65536), maybe(c.region_width, 65536);
        maybe(c.region_height, 65536), maybe(c.gain_cdb, 32768);
        if (c.gain_cdb && below(2) == 0) c.gain_cdb = static_cast<std::int16_t>(-*c.gain_cdb);
    }
    void fill(CameraTrigger& t) {
        t = {static_cast<std::uint8_t>(below(256)), static_cast<std::uint16_t>(below(65536)), below(2) == 0,
             below(std::int64_t{1} << 60)};
    }
    void fill(CameraReply& r) {
        r = {static_cast<std::uint8_t>(below(256)), static_cast<std::uint8_t>(below(256)), below(2) == 0,
             static_cast<CameraAnswer>(below(kCameraAnswers.size())), below(std::int64_t{1} << 60)};
    }
    void fill(CameraState& s) {
        s.frame = static_cast<std::uint32_t>(below(std::int64_t{1} << 32));
        s.camera = static_cast<std::uint8_t>(below(256)), s.command_counter = static_cast<std::uint8_t>(below(256));
        CameraSettings& c = s.settings;
        c.running = below(2) == 0, c.auto_exposure = below(2) == 0, c.trigger = static_cast<TriggerMode>(below(4));
        c.exposure_ns = below(std::int64_t{1} << 47), c.period_ns = below(std::int64_t{1} << 47);
        c.gain_cdb = static_cast<std::int16_t>(below(6000)), c.binning = static_cast<std::uint8_t>(below(128));
        c.region = {static_cast<std::uint16_t>(below(65536)), static_cast<std::uint16_t>(below(65536)),
                    static_cast<std::uint16_t>(below(65536)), static_cast<std::uint16_t>(below(65536))};
    }

private:
    std::mt19937_64 rng_{81};
};

std::int64_t reference(const CameraTrigger& t) {
    return t.t_ns;
}
std::int64_t reference(const CameraReply& r) {
    return r.t_ns;
}
template <class Message>
std::int64_t reference(const Message&) {
    return 3'000'000'000'000'000;
}

template <class Message>
class CanCamera : public ::testing::Test {};
using CameraMessages = ::testing::Types<CameraCommand, CameraTrigger, CameraReply, CameraState>;
TYPED_TEST_SUITE(CanCamera, CameraMessages);

TYPED_TEST(CanCamera, ComesBackInBothForms) {
    RandomCamera random;
    MessageDecoder<TypeParam> classic, fd;
    for (int trial = 0; trial < 1000; ++trial) {
        TypeParam sent, out;
        random.fill(sent);
        // The time of a duplicate is not read again.
        DecodeStatus status = DecodeStatus::not_mine;
        for (const CanFrame& f : encode_classic(sent)) status = classic.accept(f, reference(sent), out);
        if (status != DecodeStatus::duplicate) {
            EXPECT_EQ(out, sent);
        }
        ASSERT_TRUE(status == DecodeStatus::complete || status == DecodeStatus::duplicate);
        out = {};
        ASSERT_EQ(fd.accept(encode_fd(sent), reference(sent), out), DecodeStatus::complete);
        EXPECT_EQ(out, sent);
    }
}

TYPED_TEST(CanCamera, TheSameSetIsARepeatForAShortTimeOnly) {
    RandomCamera random;
    TypeParam sent, out;
    random.fill(sent);
    MessageDecoder<TypeParam> classic, fd;
    const auto send = [&](std::int64_t t_ns) {
        DecodeStatus status = DecodeStatus::not_mine;
        for (const CanFrame& f : encode_classic(sent)) status = classic.accept(f, t_ns, out);
        EXPECT_EQ(fd.accept(encode_fd(sent), t_ns, out), status);
        return status;
    };
    EXPECT_EQ(send(0), DecodeStatus::complete);
    EXPECT_EQ(send(kRepeat_ns), DecodeStatus::duplicate);
    EXPECT_EQ(send(2 * kRepeat_ns), DecodeStatus::duplicate) << "of the repeat";
    EXPECT_EQ(send(3 * kRepeat_ns + 1), DecodeStatus::complete) << "the first of a sender that was restarted";
    EXPECT_EQ(classic.count(DecodeStatus::incomplete_set), 0u);
}

TYPED_TEST(CanCamera, EveryFlippedBitIsFound) {
    RandomCamera random;
    TypeParam sent, out;
    random.fill(sent);
    std::vector<CanFrame> frames{encode_fd(sent)};
    for (const CanFrame& f : encode_classic(sent)) frames.push_back(f);
    MessageDecoder<TypeParam> decoder;
    for (const CanFrame& good : frames)
        for (std::size_t bit = 0; bit < 8u * good.size; ++bit) {
            CanFrame bad = good;
            bad.data[bit / 8] ^= static_cast<std::uint8_t>(1u << bit % 8);
            EXPECT_EQ(decoder.accept(bad, reference(sent), out), DecodeStatus::bad_checksum) << bit;
        }
}

/// Of a state nothing may be missing; of a command no choice may be unknown, and its receiver learns whom to
/// answer.
TEST(CanCameraValues, WhatIsMissingOrUnknownIsRefused) {
    RawSignals raw{};
    for (std::size_t i = 0; i < kCameraCommandSignals.size(); ++i) raw[i] = kNotAvailable;
    raw[0] = 0;
    const auto decode = [&]<class Message>(MessageDecoder<Message>& decoder, const SetLayout& layout,
                                           std::uint32_t base) {
        Message out;
        out.camera = 9;
        return decoder.accept(encode_fd(layout, raw, 1, base), 0, out);
    };
    MessageDecoder<CameraCommand> commands;
    EXPECT_EQ(decode(commands, kCameraCommandLayout, kCameraCommandBaseId), DecodeStatus::complete);
    for (const auto& [signal, value] :
         std::initializer_list<std::pair<std::size_t, std::int64_t>>{{1, 2}, {1, -1}, {2, 4}, {2, -3}, {3, 2}}) {
        const std::int64_t before = std::exchange(raw[signal], value);
        EXPECT_EQ(decode(commands, kCameraCommandLayout, kCameraCommandBaseId), DecodeStatus::not_a_number)
            << kCameraCommandSignals[signal].name << " " << value;
        raw[signal] = before;
    }
    raw[0] = 5, raw[2] = 4;
    CameraCommand command;
    EXPECT_EQ(commands.accept(encode_fd(kCameraCommandLayout, raw, 77, kCameraCommandBaseId), 0, command),
              DecodeStatus::not_a_number);
    EXPECT_EQ(command.camera, 5);
    EXPECT_EQ(command.counter, 77);
    MessageDecoder<CameraTrigger> triggers;
    CameraTrigger trigger;
    RawSignals unknown{};
    unknown[0] = 0b101, unknown[1] = 2;
    EXPECT_EQ(triggers.accept(encode_fd(kCameraTriggerLayout, unknown, 78, kCameraTriggerBaseId), 0, trigger),
              DecodeStatus::not_a_number);
    EXPECT_EQ(trigger.cameras, 0b101);
    EXPECT_EQ(trigger.counter, 78);
    MessageDecoder<CameraState> states;
    raw = {};
    EXPECT_EQ(decode(states, kCameraStateLayout, kCameraStateBaseId), DecodeStatus::complete);
    raw[5] = kNotAvailable;
    EXPECT_EQ(decode(states, kCameraStateLayout, kCameraStateBaseId), DecodeStatus::not_a_number);
}

/// No camera accepts the value that the command then has.
TEST(CanCameraValues, WhatNoCameraCanDoIsStillACommand) {
    CameraCommand sent, out;
    MessageDecoder<CameraCommand> decoder;
    RawSignals raw{};
    for (std::size_t i = 0; i < kCameraCommandSignals.size(); ++i) raw[i] = kNotAvailable;
    raw[0] = 0, raw[4] = -1, raw[6] = -5, raw[7] = -5, raw[9] = 70'000, raw[11] = -1;
    ASSERT_EQ(decoder.accept(encode_fd(kCameraCommandLayout, raw, 1, kCameraCommandBaseId), 0, out),
              DecodeStatus::complete);
    sent.counter = 1;
    sent.binning = 255;
    sent.exposure_ns = -5;
    sent.region_x = sent.region_width = 65535;
    sent.period_ns = -1;
    EXPECT_EQ(out, sent);
}

}  // namespace
}  // namespace narpa
