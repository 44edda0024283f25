// Runs with the system's UTC: steps of its clock move time stamps and no exposure.
#include "emulator/system_utc.h"

#include <cstring>
#include <thread>

#include "emulator/clock.h"
#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

UtcOffset reading{};  // of the clock in these tests
UtcOffset read_test_clock() noexcept {
    return reading;
}
constexpr std::int64_t kUtc = 1'795'871'655'250'000'000;

TEST(SystemUtc, HoldsAnOffsetThroughTheNoiseOfItsReadings) {
    reading = {kUtc, 50};
    SystemUtc utc(read_test_clock);
    for (const std::int64_t noise : {-900, 3, 999}) {
        reading.offset_ns = kUtc + noise;
        EXPECT_EQ(utc.offset_ns(), kUtc);
    }
    reading = {kUtc + 40'000, 50'000};  // the thread was interrupted
    EXPECT_EQ(utc.offset_ns(), kUtc);
    EXPECT_EQ(utc.steps(), 0u);
}

TEST(SystemUtc, FollowsStepsAndCountsEachOnce) {
    reading = {kUtc, 50};
    SystemUtc utc(read_test_clock);
    constexpr std::int64_t kHour = 3600 * kSecond_ns;
    reading.offset_ns = kUtc + kHour;
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i)
        threads.emplace_back([&] {
            for (int k = 0; k < 1000; ++k) EXPECT_EQ(utc.offset_ns(), kUtc + kHour);
        });
    for (auto& t : threads) t.join();
    EXPECT_EQ(utc.steps(), 1u);
    EXPECT_EQ(utc.last_step_ns(), kHour);
    reading.offset_ns -= kSecond_ns;  // a leap second
    EXPECT_EQ(utc.offset_ns(), kUtc + kHour - kSecond_ns);
    EXPECT_EQ(utc.steps(), 2u);
    EXPECT_EQ(utc.last_step_ns(), -kSecond_ns);
}

TEST(SystemUtc, ARunBeginsAtAWholeSecondAndItsClockDoesNotStep) {
    reading = {kUtc, 50};
    SystemUtc utc(read_test_clock);
    RealTimeClock clock(&utc);
    clock.start(50'000'000);
    const std::int64_t zero = clock.utc().zero_unix_ns;
    EXPECT_EQ(zero % kSecond_ns, 0);
    EXPECT_LT(clock.now_ns(), 0);
    EXPECT_GT(clock.now_ns(), -1'060'000'000);
    const std::int64_t at = clock.to_monotonic(0);
    reading.offset_ns += 3600 * kSecond_ns + 5;
    EXPECT_EQ(clock.utc().zero_unix_ns, zero + 3600 * kSecond_ns + 5);
    EXPECT_EQ(clock.to_monotonic(0), at);
}

TEST(SystemUtc, IsThatOfTheKernel) {
    SystemUtc utc;
    timespec real{};
    ::clock_gettime(CLOCK_REALTIME, &real);
    const std::int64_t before = real.tv_sec * kSecond_ns + real.tv_nsec, mine = monotonic_ns() + utc.offset_ns();
    ::clock_gettime(CLOCK_REALTIME, &real);
    EXPECT_GE(mine, before - 2 * SystemUtc::kNoise_ns);
    EXPECT_LE(mine, real.tv_sec * kSecond_ns + real.tv_nsec + 2 * SystemUtc::kNoise_ns);
}

/// Messages of a real-time run on a bus of its own, from its start to its end.
class SystemUtcRun : public LoopTest {};

TEST_F(SystemUtcRun, StatesUtcInLedgersPacketsAndOnCan) {
    const std::string log = folder_ / "log", capture = folder_ / "top.pcap";
    RunOptions o;
    o.bus = "slcan:0";
    o.video = {{"nav", "none"}};
    o.lidar = {{"top", capture}};
    o.duration_s = 3;
    o.log_folder = log;
    auto emulator =
        Emulator::create(scene(small_scene() + "[time]\nsource = \"system\"\n[can]\nsync_period_s = 0.25\n"
                                               "time_period_s = 0.5\ntime_id = 0x200\n"),
                         o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    const StopFlag stop{false};
    std::thread running([&] { EXPECT_TRUE((*emulator)->run(stop)); });
    const auto client = open_or_fail((*emulator)->can()->bus().address().bus, CanRole::client);
    MessageDecoder<ClockReport> decoder;
    std::vector<ClockReport> reports;
    std::vector<CanFrame> syncs, times;
    bool stopping = false;
    turn_until(*client, [&] {
        for (ReceivedFrame r; client->receive(r);) {
            ClockReport report;
            if (decoder.accept(r.frame, 0, report) == DecodeStatus::complete) reports.push_back(report);
            if (r.frame.id == kSyncId) syncs.push_back(r.frame);
            if (r.frame.id == 0x200) times.push_back(r.frame);
            Heartbeat heartbeat;
            if (decode(r.frame, 0, heartbeat) == DecodeStatus::complete)
                stopping = heartbeat.state == RunState::stopping;
        }
        return stopping;
    });
    running.join();
    const std::int64_t zero = (*emulator)->utc().zero_unix_ns;
    EXPECT_EQ(zero % kSecond_ns, 0);
    ASSERT_GE(reports.size(), 1u);
    for (const ClockReport& r : reports) {
        EXPECT_EQ(r.zero_utc_s, zero / kSecond_ns);
        EXPECT_EQ(r.zero_utc_fraction_s, 0);
        EXPECT_EQ(r.steps, 0);
    }
    EXPECT_GE(syncs.size(), 1u);
    for (const CanFrame& f : syncs) EXPECT_EQ(f.size, 0);
    ASSERT_GE(times.size(), 2u);
    const auto ms_of = [](const CanFrame& f) {
        return f.data[0] | f.data[1] << 8 | f.data[2] << 16 | f.data[3] << 24;
    };
    EXPECT_GE((ms_of(times[1]) - ms_of(times[0]) + 86'400'000) % 86'400'000, 400);
    const auto frames = read_rows(log + "/nav.ledger.csv"), sweeps = read_rows(log + "/top.sweeps.csv");
    ASSERT_GE(frames.size(), 1u);
    ASSERT_GE(sweeps.size(), 1u);
    for (const auto& rows : {frames, sweeps})
        for (auto row : rows) EXPECT_EQ(row["utc_offset_ns"], std::to_string(zero));
    // The first record of the capture: seconds and nanoseconds of its time stamp, after 24 bytes of the file's
    // header.
    const auto bytes = read_bytes(capture);
    ASSERT_GT(bytes.size(), 40u);
    std::uint32_t seconds = 0;
    std::memcpy(&seconds, &bytes[24], 4);
    EXPECT_GE(seconds, zero / kSecond_ns);
    EXPECT_LE(seconds, zero / kSecond_ns + 3) << "the run has 3 s of simulation time";
}

TEST_F(SystemUtcRun, IsRefusedInLockstep) {
    RunOptions o;
    o.bus = record(3);
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    const auto emulator = Emulator::create(scene(small_scene() + "[time]\nsource = \"system\"\n"), o);
    ASSERT_FALSE(emulator);
    EXPECT_NE(emulator.error().text().find("in lockstep no wall time enters any result"), std::string::npos);
}

TEST_F(SystemUtcRun, WithoutItUtcIsTheScenesEpoch) {
    RunOptions o;
    o.bus = record(5);
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    o.log_folder = folder_ / "log";
    ran(scene(small_scene()), o);
    for (auto row : read_rows(o.log_folder + "/nav.ledger.csv")) {
        EXPECT_EQ(row["utc_offset_ns"], "1795262400000000000");
        EXPECT_EQ(row["utc_error_ns"], "-1");
    }
}

}  // namespace
}  // namespace narpa::test
