// The real-time loop: it keeps step, takes no memory after its start, and ends when it should.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "emulator/report.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa::test {
namespace {

class RealTime : public LoopTest {
protected:
    std::unique_ptr<Emulator> start(const std::string& scene_text, const RunOptions& o) {
        auto emulator = Emulator::create(scene(scene_text), o);
        if (!emulator) ADD_FAILURE() << emulator.error().text();
        return emulator ? *std::move(emulator) : nullptr;
    }
    StopFlag stop_{false};
};

TEST_F(RealTime, MakesOrCountsEveryFrameAndPacketOfItsDuration) {
    RunOptions o;
    o.bus = record(10);
    o.duration_s = 1;
    o.video = {{"nav", folder_ / "a.y4m"}};
    o.lidar = {{"top", "udp:127.0.0.1:23680"}, {"top", folder_ / "a.pcap"}};
    const auto emulator = start(small_scene(), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE(emulator->run(stop_));
    const CameraStats& c = camera_of(*emulator).stats();
    const LidarStats& l = lidar_of(*emulator).stats();
    EXPECT_EQ(c.frames + c.skipped, 10U);
    EXPECT_GE(c.frames, 1U);
    EXPECT_EQ(l.packets + l.skipped, 1'000'000'000U / 1'327'104);
    EXPECT_GT(l.returns, 0U);
    EXPECT_EQ(emulator->can()->counters().taken, 10U);
    const VideoCounters sent = camera_of(*emulator).sinks().front()->counters();
    EXPECT_EQ(sent.written + sent.ring_full + sent.failed,
              c.handed_over + c.not_taken);  // a disk may pause for longer than the ring lasts
}

TEST_F(RealTime, AdviceStatesHowLongAFrameTakes) {
    RunOptions o;
    o.duration_s = 0.5;
    o.video = {{"nav", "none"}};
    const std::string camera = "rate_hz = 500\ndetector = {exposure_s = 0.0005, shot_noise = true}";
    const auto emulator = start(with_resolution(small_scene(camera), "[640, 480]"), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE(emulator->run(stop_));
    const CameraStats& c = camera_of(*emulator).stats();
    ASSERT_GT(c.sensor.percentile_ns(0.99), 200'000) << "it is part of the rendering, and shows beside it";
    ASSERT_EQ(advice(*emulator).size(), 1U);
    const std::string takes = fmt::format("A frame takes {:.1f} ms", c.render.percentile_ns(0.99) * 1e-6);
    EXPECT_NE(advice(*emulator)[0].find(takes), std::string::npos) << takes << "\n" << advice(*emulator)[0];
}

/// By samples, by a budget in time, and by paths within one.
class OnceItRuns : public RealTime, public ::testing::WithParamInterface<const char*> {
protected:
    static std::string busy_scene() {
        return with_render(small_scene("rate_hz = 50\ndetector = {exposure_s = 0.002, shot_noise = true}"),
                           GetParam());
    }
};

TEST_P(OnceItRuns, TheLoopAllocatesNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer brings its own heap";
    RunOptions o;
    o.bus = record(15);
    o.duration_s = 1.6;
    o.video = {{"nav", folder_ / "a.y4m"}};
    o.lidar = {{"top", "udp:127.0.0.1:23680"}, {"top", folder_ / "a.pcap"}};
    o.log_folder = folder_ / "log";
    const auto emulator = start(busy_scene(), o);
    ASSERT_TRUE(emulator);
    std::thread loop([&] { EXPECT_TRUE(emulator->run(stop_)); });
    while (emulator->t_ns() < 400'000'000) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::uint64_t calls = 0;
    {
        const AllocationCounter counter;
        while (emulator->t_ns() < 1'200'000'000) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        calls = counter.on_all_threads();
    }
    loop.join();
    EXPECT_EQ(calls, 0U);
    const CameraStats& c = camera_of(*emulator).stats();
    const LidarStats& l = lidar_of(*emulator).stats();
    EXPECT_EQ(c.frames + c.skipped, 80U);
    EXPECT_GE(c.frames, 1U);
    EXPECT_EQ(l.packets + l.skipped, 1'600'000'000U / 1'327'104);
    EXPECT_GE(l.packets, 1U);
}

TEST_P(OnceItRuns, TheLoopTouchesNoNewPage) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer's shadow memory faults";
    RunOptions o;
    o.duration_s = 1;
    o.video = {{"nav", "none"}};
    const auto emulator = start(busy_scene(), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE(emulator->run(stop_));
    const CameraStats& c = camera_of(*emulator).stats();
    EXPECT_EQ(c.frames + c.skipped, 50U);
    EXPECT_EQ(emulator->page_faults().major, 0);
    const auto refused = [](const std::string& note) { return note.find("not locked") != std::string::npos; };
    if (std::ranges::any_of(emulator->notices(), refused))
        GTEST_SKIP() << "memory cannot be locked here: minor page faults come as the kernel likes";
    EXPECT_EQ(emulator->page_faults().minor, 0);
}

INSTANTIATE_TEST_SUITE_P(By, OnceItRuns,
                         ::testing::Values("spp = 2", "budget_ms = 10", "method = \"path\"\nbudget_ms = 10"));

/// A thread above the tracing ones that does not sleep would take their processor.
TEST_F(RealTime, ARecordedBusIsWaitedForAsleep) {
    const std::string log = folder_ / "later.log";
    std::ofstream(log) << "(1000.000000) narpa 333#00\n(4600.000000) narpa 333#01\n";
    auto world = World::create(scene(small_scene()));
    ASSERT_TRUE(world);
    auto bus = open_can_bus("log:" + log, CanRole::hub);
    ASSERT_TRUE(bus);
    CanNode node(**world, **bus, nullptr, false);
    bool moved = false;
    ASSERT_TRUE(node.receive(0, moved));
    ASSERT_FALSE(node.receive(0, moved));  // due in an hour
    const std::int64_t begun = monotonic_ns();
    node.wait(0, 20'000'000);
    EXPECT_GE(monotonic_ns() - begun, 20'000'000);
    node.wait(3'600'000'000'000, 20'000'000'000);  // due by now
    EXPECT_TRUE(node.receive(3'600'000'000'000, moved));
}

/// Without a duration: after the last of what is recorded, not while that waits for its time.
TEST_F(RealTime, ARunOnALogEndsAfterItsLastFrame) {
    const std::string log = folder_ / "half.log";
    std::ofstream(log) << "(1000.000000) narpa 333#00\n(1000.500000) narpa 333#01\n";
    RunOptions o;
    o.bus = "log:" + log;
    o.video = {{"nav", "none"}};
    const auto emulator = start(small_scene(), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE(emulator->run(stop_));
    const CameraStats& c = camera_of(*emulator).stats();
    EXPECT_GE(c.frames + c.skipped, 5U);
    EXPECT_EQ(emulator->can()->counters().foreign, 2U);
}

/// A camera that is always behind gets to the end all the same: that is where the bus ended, and does not move on
/// while frames of many milliseconds are made.
TEST_F(RealTime, AnOverloadedRunOnALogEnds) {
    RunOptions o;
    o.bus = record(1);
    o.video = {{"nav", "none"}};
    o.log_folder = folder_ / "log";
    const auto emulator = start(with_render(small_scene("rate_hz = 50"), "spp = 1024"), o);
    ASSERT_TRUE(emulator);
    std::atomic<bool> ended{false};
    std::thread loop([&] {
        EXPECT_TRUE(emulator->run(stop_));
        ended = true;
    });
    while (!ended && emulator->t_ns() < 20'000'000'000) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_TRUE(ended);
    stop_ = true;
    loop.join();
    const auto frames = read_rows(o.log_folder + "/nav.ledger.csv");
    ASSERT_FALSE(frames.empty());
    EXPECT_LT(emulator->t_ns(), std::stoll(frames.front().at("t_hand_over_ns")));
}

TEST_F(RealTime, AReaderThatDoesNotReadCostsNoFrameItsTime) {
    const std::string fifo = folder_ / "nav.fifo";
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    const int reader = ::open(fifo.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(reader, 0);
    // A pipe of at most a few pages holds none of these frames whole, and a slow machine makes enough of them to
    // fill the sink.
    ASSERT_GT(::fcntl(reader, F_SETPIPE_SZ, 1), 0);
    RunOptions o;
    o.duration_s = 3;
    o.video = {{"nav", fifo}};
    o.log_folder = folder_ / "log";
    const auto emulator = start(with_resolution(small_scene("rate_hz = 25"), "[80, 64]"), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE(emulator->run(stop_));
    ::close(reader);
    const CameraStats& c = camera_of(*emulator).stats();
    const VideoCounters sent = camera_of(*emulator).sinks().front()->counters();
    EXPECT_EQ(c.frames + c.skipped, 75U);
    EXPECT_GT(c.frames, sent.written);  // the loop went on without the reader
    EXPECT_EQ(sent.written + sent.no_reader + sent.failed, c.handed_over);
    EXPECT_EQ(sent.ring_full, c.not_taken);
    EXPECT_GT(c.not_taken, 0U);
    for (const auto& row : read_rows(o.log_folder + "/nav.ledger.csv"))
        EXPECT_EQ(row.at("delivery") == "nothing", row.at("t_hand_over_ns") == "0");
    EXPECT_EQ(std::ranges::count(read_rows(o.log_folder + "/nav.ledger.csv"), "nothing",
                                 [](const auto& row) { return row.at("delivery"); }),
              static_cast<std::ptrdiff_t>(c.not_taken));
}

TEST_F(RealTime, WhatWasMissedIsNotMadeUpFor) {
    EXPECT_EQ(next_due_ns(300, 100, 300), 400);
    EXPECT_EQ(next_due_ns(300, 100, 399), 400);
    EXPECT_EQ(next_due_ns(300, 100, 400), 500);
    EXPECT_EQ(next_due_ns(300, 100, 3'350), 3'400);
}

TEST_F(RealTime, ABudgetLongerThanAPeriodIsRefused) {
    RunOptions o;
    o.video = {{"nav", "none"}};
    Scene overridden = scene(small_scene("rate_hz = 10"));
    overridden.render.budget_ns = 101'000'000;  // as the command line does; of a scene's own its file tells
    const auto emulator = Emulator::create(std::move(overridden), o);
    ASSERT_FALSE(emulator);
    EXPECT_EQ(emulator.error().text(), "--budget-ms 101, expected at most the period of camera \"nav\", 100 ms");
}

TEST_F(RealTime, StopsWhenAskedAndFlushesEverything) {
    RunOptions o;
    o.video = {{"nav", folder_ / "a.y4m"}};
    const auto emulator = start(small_scene(), o);
    ASSERT_TRUE(emulator);
    std::thread loop([&] { EXPECT_TRUE(emulator->run(stop_)); });
    while (emulator->t_ns() < 250'000'000) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    stop_ = true;
    loop.join();
    const std::string video = read_text(folder_ / "a.y4m");
    const VideoCounters sent = camera_of(*emulator).sinks().front()->counters();
    EXPECT_GE(sent.written, 1U);
    const CameraStats& stats = camera_of(*emulator).stats();
    EXPECT_EQ(sent.written + sent.ring_full + sent.failed, stats.handed_over + stats.not_taken);
    EXPECT_EQ((video.size() - video.find('\n') - 1) % (64 * 48 + 6), 0U);
    EXPECT_EQ((video.size() - video.find('\n') - 1) / (64 * 48 + 6), sent.written);
    // Nobody commands: every frame says so.
    EXPECT_EQ(camera_of(*emulator).stats().stale, camera_of(*emulator).stats().frames);
}

}  // namespace
}  // namespace narpa::test
