// Lockstep: the clock is the bus, and nothing but the commands decides what comes out.
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

class Lockstep : public LoopTest {
protected:
    struct Files {
        std::string video, capture, truth, ledger;
        friend bool operator==(const Files&, const Files&) = default;
    };
    /// Runs the small scene over the recorded commands and reads back everything it left.
    Files run(const std::string& scene_text, const std::string& bus, int threads, const std::string& name,
              CommandCounters* counters = nullptr) {
        const std::string out = folder_ / name.c_str();
        RunOptions o;
        o.bus = bus;
        o.lockstep = true;
        o.threads = threads;
        o.log_folder = out;
        o.video = {{"nav", out + ".y4m"}};
        o.lidar = {{"top", out + ".pcap"}};
        auto emulator = ran(scene(scene_text), o);
        if (!emulator) return {};
        if (counters) *counters = emulator->can()->counters();
        frames_ = camera_of(*emulator).stats().frames;
        packets_ = lidar_of(*emulator).stats().packets;
        emulator.reset();
        return {read_text(out + ".y4m"), read_text(out + ".pcap"), read_text(out + "/nav.truth.csv"),
                read_text(out + "/nav.ledger.csv")};
    }
    std::uint64_t frames_ = 0, packets_ = 0;
};

TEST_F(Lockstep, MakesEveryFrameAndPacketUpToTheNewestCommand) {
    run(small_scene(), record(21), 0, "a");
    EXPECT_EQ(frames_, 21U);                          // 0.0, 0.1 ... 2.0 s
    EXPECT_EQ(packets_, 2'000'000'000U / 1'327'104);  // complete by 2.0 s
}

TEST_F(Lockstep, IsTheSameBytesOnOneAndOnManyThreads) {
    const std::string bus = record(12);
    std::string noisy = small_scene(
        "rate_hz = 20\ndetector = {exposure_s = 0.002, shot_noise = true, read_noise_e = 5.0, bits = 12}\nformat = "
        "\"Y16\"\nembedded_line = true");
    noisy = with_resolution(noisy, "[80, 48]");  // wide enough for the embedded line
    const Files one = run(noisy, bus, 1, "one");
    EXPECT_GT(one.video.size(), 64U * 48 * 20);
    EXPECT_TRUE(one == run(noisy, bus, 2, "two"));
    EXPECT_TRUE(one == run(noisy, bus, 7, "seven"));
}

TEST_F(Lockstep, AFrameIsWhatTheCameraUnitMakesOfTheSamePose) {
    const Files files = run(small_scene(), record(4), 0, "run");
    auto world = World::create(scene(small_scene()));
    ASSERT_TRUE(world);
    CameraUnit unit(**world, 0);
    std::string expected;
    for (int k = 0; k < 4; ++k) {
        PoseCommand sent = command(k), received;
        CanFrame frame;
        PoseDecoder decoder(0x100);
        ASSERT_TRUE(encode_fd(sent, 0x100, frame));
        ASSERT_EQ(decoder.accept(frame, 0, received), PoseStatus::complete);
        ASSERT_EQ((*world)->track(1)->push(received, 0), TrackStatus::taken);
        unit.expose(static_cast<std::uint32_t>(k), sent.t_valid_ns);
        expected += "FRAME\n" + std::string(unit.bytes().begin(), unit.bytes().end());
    }
    ASSERT_GT(files.video.size(), expected.size());
    EXPECT_EQ(files.video.substr(files.video.size() - expected.size()), expected);
}

TEST_F(Lockstep, DropsAndCountsWhatIsWrongOnTheBus) {
    const std::string spec = "log:" + (folder_ / "bad.log");
    {
        auto bus = open_can_bus(spec, CanRole::client);
        ASSERT_TRUE(bus);
        const auto send = [&](CanFrame f, auto change) {
            change(f);
            (*bus)->send(f);
        };
        const auto pose = [](int k) {
            CanFrame f;
            EXPECT_TRUE(encode_fd(command(k), 0x100, f));
            return f;
        };
        const auto unchanged = [](CanFrame&) {};
        send(pose(0), unchanged);
        send(pose(0), unchanged);                               // duplicated
        send(pose(1), [](CanFrame& f) { f.data[9] ^= 0x40; });  // corrupt
        send(pose(2), [](CanFrame& f) { f.size = 48; });        // short
        send(pose(3), unchanged);
        send(pose(2), unchanged);                          // from the past
        send(pose(4), [](CanFrame& f) { f.id = 0x333; });  // foreign
        send(pose(5), unchanged);
    }
    CommandCounters c;
    run(small_scene(), spec, 0, "bad", &c);
    EXPECT_EQ(c.taken, 3U);
    EXPECT_EQ(c.past, 1U);
    EXPECT_EQ(c.foreign, 1U);
    EXPECT_EQ(c.by_status[static_cast<std::size_t>(DecodeStatus::bad_checksum)], 1U);
    EXPECT_EQ(c.by_status[static_cast<std::size_t>(DecodeStatus::too_short)], 1U);
    EXPECT_EQ(c.by_status[static_cast<std::size_t>(DecodeStatus::duplicate)], 1U);
    EXPECT_EQ(c.missed, 3U);  // 1, 2 and 4
    EXPECT_EQ(frames_, 6U);   // still every frame from 0.0 to 0.5 s
}

TEST_F(Lockstep, EndsBeforeTheFrameAtItsDuration) {
    RunOptions o;
    o.bus = record(21);
    o.lockstep = true;
    o.duration_s = 1;
    o.video = {{"nav", "none"}};
    const auto emulator = ran(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(camera_of(*emulator).stats().frames, 10U);
    EXPECT_EQ(emulator->t_ns(), 1'000'000'000);
}

TEST_F(Lockstep, TakesNoBudgetInWallTime) {
    RunOptions o;
    o.bus = record(2);
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    const auto emulator = Emulator::create(scene(with_render(small_scene(), "budget_ms = 10")), o);
    ASSERT_FALSE(emulator);
    EXPECT_NE(emulator.error().text().find("--budget-rays"), std::string::npos) << emulator.error().text();
}

}  // namespace
}  // namespace narpa::test
