// A run that passes the wrap of every counter on the bus is the same run.
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

class Wraps : public LoopTest {};

// Fourteen days in lockstep, a frame every 100 s: times of 48 bits in nanoseconds wrap after 3.3 days, heartbeats
// of 40 bits in microseconds after 12.7, counters of 8 bits 47 times.
TEST_F(Wraps, OfTimesAndCountersLeaveNoTrace) {
    constexpr int kFrames = 12'097;
    constexpr std::int64_t kPeriod = 100 * kSecond_ns;
    const std::string bus = folder_ / "commands.log";
    {
        const auto log = open_can_bus("log:" + bus, CanRole::client);
        ASSERT_TRUE(log) << log.error().text();
        for (int k = 0; k < kFrames; ++k) {
            CanFrame frame;
            ASSERT_TRUE(
                encode_fd({static_cast<std::uint8_t>(k), k * kPeriod, {{{}, {-10, 0, 0}}, {}, {}}}, 0x100, frame));
            ASSERT_TRUE((*log)->send(frame));
        }
    }
    RunOptions o;
    o.bus = "log:" + bus;
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    o.log_folder = folder_ / "log";
    const std::string text = with_render(with_resolution(small_scene("rate_hz = 0.01"), "[16, 12]"),
                                         "spp = 1\ncommand_ahead_max_s = 1000\nstale_after_s = 1000");
    const auto emulator = ran(scene(text), o);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(emulator->can()->counters().taken, static_cast<std::uint64_t>(kFrames));
    EXPECT_EQ(emulator->can()->counters().missed, 0u);
    for (const auto& [cause, n] : emulator->can()->counters().rejected()) EXPECT_EQ(n, 0u) << cause;
    auto rows = read_rows(o.log_folder + "/nav.ledger.csv");
    ASSERT_EQ(rows.size(), static_cast<std::size_t>(kFrames));
    for (int k = 0; k < kFrames; ++k) {
        auto& row = rows[static_cast<std::size_t>(k)];
        ASSERT_EQ(row["t_exposure_mid_ns"], std::to_string(k * kPeriod));
        ASSERT_EQ(row["t_pose_ns"], std::to_string(k * kPeriod));
        ASSERT_EQ(row["pose_counter"], std::to_string(k % 256));
        ASSERT_EQ(row["stale"], "0");
        ASSERT_EQ(row["image_crc32"], rows[0]["image_crc32"]) << "frame " << k;
    }
    // What a receiver on the bus makes of it: the low bits, and its own clock for the others.
    std::int64_t t_now = 0;
    int ledgers = 0, heartbeats = 0;
    MessageDecoder<FrameLedger> decoder(0);
    const auto sent = open_can_bus("log:" + o.log_folder + "/can.log:narpa", CanRole::hub);
    ASSERT_TRUE(sent) << sent.error().text();
    for (ReceivedFrame r; (*sent)->receive(r);) {
        FrameLedger ledger;
        Heartbeat heartbeat;
        if (decoder.accept(r.frame, t_now, ledger) == DecodeStatus::complete) {
            ASSERT_EQ(ledger.t_exposure_mid_ns, kPeriod * ledgers);
            ++ledgers;
        }
        if (decode(r.frame, t_now, heartbeat) == DecodeStatus::complete && ++heartbeats > 1) {
            ASSERT_GE(heartbeat.t_ns, t_now);
            t_now = heartbeat.t_ns;
        }
    }
    EXPECT_EQ(ledgers, kFrames);
    EXPECT_EQ(t_now, (kFrames - 1) * kPeriod);
}

}  // namespace
}  // namespace narpa::test
