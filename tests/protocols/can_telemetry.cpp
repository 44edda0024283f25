#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

FrameLedger random_frame_ledger(std::mt19937_64& rng) {
    const auto up_to = [&](std::int64_t n) {
        return static_cast<std::int64_t>(rng() % static_cast<std::uint64_t>(n));
    };
    FrameLedger l;
    l.frame = static_cast<std::uint32_t>(rng());
    l.camera = static_cast<std::uint8_t>(up_to(16));
    l.pose_counter = static_cast<std::uint8_t>(rng());
    l.pose_stale = rng() % 2 == 0;
    l.deadline_met = rng() % 2 == 0;
    l.delivery = static_cast<Delivery>(up_to(4));
    l.step = static_cast<std::uint8_t>(up_to(6));
    l.budget_kind = static_cast<BudgetKind>(up_to(3));
    l.budget = static_cast<std::uint64_t>(up_to(std::int64_t{1} << 40));
    l.samples = static_cast<std::uint64_t>(up_to(std::int64_t{1} << 40));
    l.rays = static_cast<std::uint64_t>(up_to(std::int64_t{1} << 40));
    l.samples_per_pixel = static_cast<float>(up_to(1 << 24)) / 256;
    l.expected_error =
        up_to(4) == 0 ? -1.0F : static_cast<float>(static_cast<double>(up_to(1'000'000)) / kExpectedErrorSteps);
    l.t_exposure_mid_ns = 1'000'000'000 + up_to(std::int64_t{1} << 50);
    l.t_pose_ns = l.t_exposure_mid_ns - up_to(100'000'000);
    for (std::int64_t* t : {&l.t_exposure_start_ns, &l.t_exposure_end_ns, &l.t_render_start_ns, &l.t_render_end_ns,
                            &l.t_hand_over_ns, &l.t_deadline_ns})
        *t = l.t_exposure_mid_ns + 1000 * (up_to(16'000'000) - 8'000'000);
    return l;
}

TEST(CanLedger, ClassicAndFdCarryTheSame) {
    std::mt19937_64 rng(5);
    for (int i = 0; i < 5000; ++i) {
        const FrameLedger sent = random_frame_ledger(rng);
        FrameLedger from_classic, from_fd;
        LedgerDecoder classic(sent.camera), fd(sent.camera);
        DecodeStatus status = DecodeStatus::not_mine;
        for (const CanFrame& f : encode_classic(sent)) {
            EXPECT_EQ(f.data[6], sent.frame & 0xFF);
            EXPECT_EQ(f.id & 0x7F0, 0x600u + 16u * sent.camera);
            status = classic.accept(f, sent.t_exposure_mid_ns, from_classic);
        }
        ASSERT_EQ(status, DecodeStatus::complete);
        ASSERT_EQ(fd.accept(encode_fd(sent), sent.t_exposure_mid_ns, from_fd), DecodeStatus::complete);
        ASSERT_EQ(from_classic, sent);
        ASSERT_EQ(from_fd, sent);
    }
}

TEST(CanLedger, MarksMissingCommandAndHandOver) {
    FrameLedger sent, out;
    sent.t_exposure_mid_ns = 5'000'000'000;
    sent.t_exposure_start_ns = sent.t_exposure_end_ns = sent.t_render_start_ns = sent.t_render_end_ns =
        sent.t_deadline_ns = sent.t_exposure_mid_ns;
    sent.pose_stale = true;
    LedgerDecoder decoder;
    ASSERT_EQ(decoder.accept(encode_fd(sent), 5'000'000'000, out), DecodeStatus::complete);
    EXPECT_EQ(out, sent);
    EXPECT_EQ(out.t_pose_ns, 0);
    EXPECT_EQ(out.t_hand_over_ns, 0);
}

TEST(CanLedger, OffsetsRoundAndSaturate) {
    FrameLedger sent, out;
    sent.t_exposure_mid_ns = 100'000'000'000;
    sent.t_exposure_start_ns = sent.t_exposure_mid_ns - 1'499;
    sent.t_exposure_end_ns = sent.t_exposure_mid_ns + 1'500;
    sent.t_render_start_ns = 0;
    sent.t_render_end_ns = 900'000'000'000;
    LedgerDecoder decoder;
    ASSERT_EQ(decoder.accept(encode_fd(sent), 0, out), DecodeStatus::complete);
    EXPECT_EQ(out.t_exposure_start_ns, sent.t_exposure_mid_ns - 1'000);
    EXPECT_EQ(out.t_exposure_end_ns, sent.t_exposure_mid_ns + 2'000);
    EXPECT_EQ(out.t_render_start_ns, sent.t_exposure_mid_ns - 8'388'607'000);
    EXPECT_EQ(out.t_render_end_ns, sent.t_exposure_mid_ns + 8'388'607'000);
}

TEST(CanLedger, CountsAndErrorsSaturate) {
    FrameLedger sent, out;
    sent.samples = UINT64_MAX;
    sent.rays = std::uint64_t{1} << 40;
    sent.budget = (std::uint64_t{1} << 40) - 1;
    sent.samples_per_pixel = 1e9F;
    sent.expected_error = INFINITY;
    sent.passes = {1000, 2000, 3000};
    LedgerDecoder decoder;
    ASSERT_EQ(decoder.accept(encode_fd(sent), 0, out), DecodeStatus::complete);
    EXPECT_EQ(out.samples, (std::uint64_t{1} << 40) - 1);
    EXPECT_EQ(out.rays, (std::uint64_t{1} << 40) - 1);
    EXPECT_EQ(out.budget, (std::uint64_t{1} << 40) - 1);
    EXPECT_FLOAT_EQ(out.samples_per_pixel, 65536.0F - 1.0F / 256);
    EXPECT_FLOAT_EQ(out.expected_error, 8'388'607 / 5e6F);
    sent.expected_error = NAN;  // no number is no estimate
    sent.samples_per_pixel = NAN;
    sent.frame = 1;
    ASSERT_EQ(decoder.accept(encode_fd(sent), 0, out), DecodeStatus::complete);
    EXPECT_LT(out.expected_error, 0);
    EXPECT_EQ(out.samples_per_pixel, 0);
}

TEST(CanLedger, RefusesUnknownChoices) {
    FrameLedger sent, out;
    sent.step = 7;
    LedgerDecoder decoder;
    EXPECT_EQ(decoder.accept(encode_fd(sent), 0, out), DecodeStatus::not_a_number);
    sent.step = 6;
    sent.budget_kind = static_cast<BudgetKind>(3);
    EXPECT_EQ(decoder.accept(encode_fd(sent), 0, out), DecodeStatus::not_a_number);
}

TEST(CanLedger, EachCameraHasItsOwnIdentifiers) {
    FrameLedger sent, out;
    sent.camera = 3;
    LedgerDecoder other(0), own(3);
    EXPECT_EQ(other.accept(encode_fd(sent), 0, out), DecodeStatus::not_mine);
    EXPECT_EQ(own.accept(encode_fd(sent), 0, out), DecodeStatus::complete);
}

TEST(CanHeartbeat, RoundTrip) {
    for (int i = 0; i < 256; ++i) {
        const Heartbeat sent{.t_ns = 1'000'000 * std::int64_t{i} * i,
                             .state = static_cast<RunState>(i % 4),
                             .no_command = (i & 1) != 0,
                             .stale = (i & 2) != 0,
                             .deadline_missed = (i & 4) != 0,
                             .output_dropped = (i & 8) != 0,
                             .counter = static_cast<std::uint8_t>(i)};
        const CanFrame f = encode(sent);
        EXPECT_EQ(f.id, 0x701u);
        EXPECT_EQ(f.size, 8);
        EXPECT_EQ(f.data[6], i);
        Heartbeat out;
        ASSERT_EQ(decode(f, sent.t_ns, out), DecodeStatus::complete);
        ASSERT_EQ(out, sent);
    }
}

TEST(CanHeartbeat, TimeWrapsUnseen) {
    Heartbeat sent, out;
    sent.t_ns = 1000 * ((std::int64_t{1} << 40) + 5);
    ASSERT_EQ(decode(encode(sent), sent.t_ns - 1'000'000'000, out), DecodeStatus::complete);
    EXPECT_EQ(out.t_ns, sent.t_ns);
}

TEST(CanHeartbeat, RejectsDamage) {
    Heartbeat out;
    CanFrame f = encode(Heartbeat{});
    f.data[5] ^= 0x01;
    EXPECT_EQ(decode(f, 0, out), DecodeStatus::bad_checksum);
    f = encode(Heartbeat{});
    f.size = 7;
    EXPECT_EQ(decode(f, 0, out), DecodeStatus::too_short);
    f = encode(Heartbeat{});
    f.remote = true;
    EXPECT_EQ(decode(f, 0, out), DecodeStatus::wrong_kind);
    EXPECT_EQ(decode(encode(Heartbeat{.state = static_cast<RunState>(9)}), 0, out), DecodeStatus::not_a_number);
}

}  // namespace
}  // namespace narpa
