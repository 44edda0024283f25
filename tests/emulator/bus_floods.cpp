// What narpa does with a bus that others flood, and with commands for a far future.
#include <sys/stat.h>

#include <thread>

#include "drivers/can/remote_clock.h"
#include "emulator/bus/can_node.h"
#include "emulator/log/row_log.h"
#include "protocols/can/candump.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

/// Delivers the frames that the test puts into it.
class TestBus final : public CanBus {
public:
    explicit TestBus(bool recorded = false) : recorded_(recorded) {}
    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        if (next_ == frames.size()) return false;
        out = frames[next_++];
        return true;
    }
    bool send(const CanFrame&) noexcept override { return true; }
    void wait(std::int64_t) noexcept override {}
    [[nodiscard]] bool recorded() const noexcept override { return recorded_; }
    [[nodiscard]] bool carries_fd() const noexcept override { return true; }
    [[nodiscard]] std::string description() const override { return "test"; }

    std::vector<ReceivedFrame> frames;

private:
    bool recorded_;
    std::size_t next_ = 0;
};

/// The lines of a can.log, by what they are.
struct LogLines {
    std::uint64_t commands = 0, heartbeats = 0, others = 0, left_out = 0, statements = 0;
};
LogLines read_log(const std::string& path) {
    LogLines lines;
    std::ifstream in(path);
    for (std::string text; std::getline(in, text);) {
        CandumpLine line;
        EXPECT_EQ(parse_candump(text, line), nullptr) << text;
        if (line.frame.error) {
            ++lines.statements;
            for (int i = 0; i < 4; ++i) lines.left_out += std::uint64_t{line.frame.data[4 + i]} << (8 * i);
        } else {
            ++(line.frame.id == 0x10F          ? lines.commands
               : line.frame.id == kHeartbeatId ? lines.heartbeats
                                               : lines.others);
        }
    }
    return lines;
}

class BusFlood : public LoopTest {
protected:
    void SetUp() override {
        auto made = World::create(scene(with_render(small_scene(), "spp = 2\ncommand_ahead_max_s = 5")));
        ASSERT_TRUE(made) << made.error().text();
        world_ = *std::move(made);
    }
    std::unique_ptr<RowLog> log(const std::string& path, bool wait_when_full) {
        auto log = RowLog::create(path, "", wait_when_full, CanNode::kLogLines);
        if (!log) ADD_FAILURE() << log.error().text();
        return *std::move(log);
    }
    /// A command that has `nanoseconds` after k * 100 ms.
    static CanFrame pose(int k, std::int64_t nanoseconds = 0) {
        PoseCommand c = command(k);
        c.t_valid_ns += nanoseconds;
        CanFrame frame;
        EXPECT_TRUE(encode_fd(c, 0x100, frame));
        return frame;
    }
    static CanFrame foreign() {
        CanFrame frame;
        frame.id = 0x7F0;
        frame.size = 8;
        return frame;
    }
    /// Of a flood: `seconds` in which each command is followed by so many foreign frames.
    void flood(CanNode& node, TestBus& bus, int seconds, int foreign_frames) {
        bool moved = false;
        for (int k = 0; k < 10 * seconds; ++k) {
            const std::int64_t now_ns = k * 100'000'000LL;
            bus.frames.push_back({pose(k)});
            bus.frames.insert(bus.frames.end(), static_cast<std::size_t>(foreign_frames), {foreign()});
            while (node.receive(now_ns, moved)) {
            }
            node.send(Heartbeat{.t_ns = now_ns}, now_ns);
        }
    }
    /// Sends one command at `t_now_ns`; true: it was accepted.
    static bool takes(CanNode& node, TestBus& bus, const CanFrame& frame, std::int64_t t_now_ns) {
        bool moved = false;
        bus.frames.push_back({frame, t_now_ns});
        EXPECT_TRUE(node.receive(t_now_ns, moved));
        return moved;
    }
    std::unique_ptr<World> world_;
};

TEST_F(BusFlood, TheLogHasEveryCommandAndStatesHowManyOtherFramesItDoesNotHave) {
    const std::string path = folder_ / "can.log";
    TestBus bus;
    auto rows = log(path, true);
    CanNode node(*world_, bus, rows.get(), false);
    flood(node, bus, 3, 10'000);  // 100,000 a second
    ASSERT_TRUE(rows->close());
    const LogLines lines = read_log(path);
    EXPECT_EQ(lines.commands, 30U);
    EXPECT_EQ(lines.heartbeats, 30U);
    EXPECT_EQ(lines.others, 3 * CanNode::kOtherFramesPerSecond);
    EXPECT_EQ(lines.others + lines.left_out, 300'000U);
    EXPECT_LE(lines.statements, 30U);
    EXPECT_EQ(node.counters().not_logged, lines.left_out);
    EXPECT_EQ(node.counters().foreign, 300'000U);
}

TEST_F(BusFlood, TheLogHasAllFramesOfABusThatIsNotFlooded) {
    const std::string path = folder_ / "can.log";
    TestBus bus;
    auto rows = log(path, true);
    CanNode node(*world_, bus, rows.get(), false);
    flood(node, bus, 2, 1'000);
    ASSERT_TRUE(rows->close());
    const LogLines lines = read_log(path);
    EXPECT_EQ(lines.others, 20'000U);
    EXPECT_EQ(lines.statements, 0U);
    EXPECT_EQ(node.counters().not_logged, 0U);
}

TEST_F(BusFlood, ADiskThatStallsCostsNoCommandItsLine) {
    const std::string path = folder_ / "can.log", kept = folder_ / "kept.log";
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    std::ifstream disk;
    std::thread opens([&] { disk.open(path); });
    TestBus bus;
    auto rows = log(path, false);
    opens.join();
    CanNode node(*world_, bus, rows.get(), false);
    flood(node, bus, 100, 200);  // nobody reads yet: the pipe and the ring fill
    EXPECT_GT(node.counters().not_logged, 0U);
    std::thread reads([&] { std::ofstream(kept) << disk.rdbuf(); });
    while (rows->crowded()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const Status closed = rows->close();
    reads.join();
    EXPECT_TRUE(closed) << closed.error().text();
    const LogLines lines = read_log(kept);
    EXPECT_EQ(lines.commands, 1000U);
    EXPECT_EQ(lines.heartbeats, 1000U);
    EXPECT_EQ(lines.others + lines.left_out, 200'000U);
}

TEST_F(BusFlood, ALogWithFramesLeftOutIsPlayedLikeAnyOther) {
    const std::string path = folder_ / "can.log";
    TestBus bus;
    auto rows = log(path, true);
    CanNode node(*world_, bus, rows.get(), false);
    flood(node, bus, 2, 3'000);
    ASSERT_TRUE(rows->close());
    auto again = open_can_bus("log:" + path, CanRole::hub);
    ASSERT_TRUE(again) << again.error().text();
    auto world = World::create(scene(small_scene()));
    ASSERT_TRUE(world);
    CanNode reader(**world, **again, nullptr, true);
    bool moved = false;
    while (reader.receive(0, moved)) {
    }
    EXPECT_EQ(reader.counters().taken, 20U);
    EXPECT_GT((*again)->counters().error_frames, 0U);
}

TEST_F(BusFlood, AClosedLoopsMessagesAreLoggedHoweverManyTheyAre) {
    const std::string path = folder_ / "can.log";
    TestBus bus;
    auto rows = log(path, true);
    CanNode node(*world_, bus, rows.get(), false);
    CanFrame message = foreign();
    message.id = kActuatorBaseId;
    bus.frames.assign(30'000, {message});
    message.extended = true;  // 29 bits: another's
    bus.frames.insert(bus.frames.end(), 30'000, {message});
    bool moved = false;
    while (node.receive(0, moved)) {
    }
    node.send(Heartbeat{}, 0);
    ASSERT_TRUE(rows->close());
    EXPECT_EQ(read_log(path).others, 40'000U);
    EXPECT_EQ(node.counters().not_logged, 20'000U);
}

TEST_F(BusFlood, AReaderOfABusThatAlwaysHasANextFrameDoesItsOtherWorkToo) {
    struct : CanBus {
        bool receive(ReceivedFrame& out) noexcept override { return out = {foreign()}, true; }
        bool send(const CanFrame&) noexcept override { return true; }
        void wait(std::int64_t) noexcept override {}
        bool carries_fd() const noexcept override { return true; }
        std::string description() const override { return "flooded"; }
    } bus;
    RemoteClock clock;
    clock.listen(bus);
    EXPECT_FALSE(clock.synchronized());
}

constexpr std::int64_t kLimit = 5'000'000'000;

TEST_F(BusFlood, InLockstepACommandMayBeAsFarAheadOfTheLastAsTheSceneStates) {
    TestBus bus;
    CanNode node(*world_, bus, nullptr, true);
    constexpr std::int64_t kStart = 20'000'000'000;  // the first command starts the clock
    EXPECT_TRUE(takes(node, bus, pose(200), 0));
    EXPECT_FALSE(takes(node, bus, pose(201, kLimit - 100'000'000 + 1), kStart));
    EXPECT_EQ(node.granted_ns(), kStart);
    EXPECT_TRUE(takes(node, bus, pose(202, kLimit - 200'000'000), kStart));
    EXPECT_EQ(node.granted_ns(), kStart + kLimit);
    EXPECT_EQ(node.counters().too_far_ahead, 1U);
    EXPECT_EQ(node.counters().taken, 2U);
}

TEST_F(BusFlood, InRealTimeACommandMayBeAsFarAheadOfTheClockAsTheSceneStates) {
    TestBus bus;
    CanNode node(*world_, bus, nullptr, false);
    EXPECT_FALSE(takes(node, bus, pose(0, kLimit + 1), 0));
    EXPECT_TRUE(takes(node, bus, pose(1, kLimit - 100'000'000), 0));
    EXPECT_FALSE(takes(node, bus, pose(2, kLimit), 0)) << "not further by a chain of commands";
    EXPECT_TRUE(takes(node, bus, pose(3, kLimit), 100'000'000'000)) << "after a silence";
    EXPECT_EQ(node.counters().too_far_ahead, 2U);
}

TEST_F(BusFlood, ARecordedCommandMayFollowAPauseOfTheRecording) {
    TestBus bus(true);
    CanNode node(*world_, bus, nullptr, true);
    EXPECT_TRUE(takes(node, bus, pose(0), 0));
    bool moved = false;
    bus.frames.push_back({pose(1, 4 * kLimit), 4 * kLimit});
    EXPECT_TRUE(node.receive(0, moved) && moved);
    bus.frames.push_back({pose(2, 10 * kLimit), 4 * kLimit});
    EXPECT_TRUE(node.receive(4 * kLimit, moved) && !moved);
}

TEST_F(BusFlood, ABodyWhoseCommandsAreAllPastIsReported) {
    for (const int repeats : {1, 12}) {
        const std::string spec = "log:" + (folder_ / (std::to_string(repeats) + ".log").c_str());
        {
            auto bus = open_can_bus(spec, CanRole::client);
            ASSERT_TRUE(bus);
            (*bus)->send(pose(0));
            (*bus)->send(pose(1, 59'000'000'000));  // of a wrong clock
            for (int k = 2; k < 2 + repeats; ++k) (*bus)->send(pose(k));
        }
        RunOptions o;
        o.bus = spec;
        o.lockstep = true;
        o.video = {{"nav", "none"}};
        const auto emulator = Emulator::create(scene(small_scene()), o);
        ASSERT_TRUE(emulator);
        CanNode& node = *(*emulator)->can();
        bool moved = false;
        while (node.receive(0, moved)) {
        }
        EXPECT_EQ(node.counters().past, static_cast<std::uint64_t>(repeats));
        EXPECT_EQ(node.refuses_poses(), repeats > 1);
        ASSERT_TRUE((*emulator)->run(StopFlag{false}));
        const std::string expected =
            "pose commands of \"chaser\" (can_id 0x100) refused: 12 as past (not newer than its newest, for 59.100 "
            "s), "
            "0 as overrun (more than are kept); check the sender's clock and rate";
        EXPECT_EQ((*emulator)->notices(), repeats > 1 ? std::vector{expected} : std::vector<std::string>{});
    }
}

TEST_F(BusFlood, InRealTimeRefusalsAreToldDuringTheRun) {
    const std::string spec = "log:" + (folder_ / "past.log");
    {
        auto bus = open_can_bus(spec, CanRole::client);
        ASSERT_TRUE(bus);
        (*bus)->send(pose(0));
        (*bus)->send(pose(1, 30'000'000'000));
        for (int k = 2; k < 14; ++k) (*bus)->send(pose(k));
    }
    StopFlag stop{false};
    std::vector<std::string> refusals;
    RunOptions o;
    o.bus = spec;
    o.duration_s = 3600;  // the refusal ends it
    o.video = {{"nav", "none"}};
    o.on_refusal = [&](const std::string& what) {
        refusals.push_back(what);
        stop = true;
    };
    const auto emulator = Emulator::create(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    ASSERT_TRUE((*emulator)->run(stop));
    ASSERT_EQ(refusals.size(), 1U);
    EXPECT_NE(refusals[0].find("pose commands of \"chaser\" (can_id 0x100) refused: "), std::string::npos)
        << refusals[0];
}

TEST_F(BusFlood, ALockstepRunMakesNoFramesForARefusedCommandAndReportsIt) {
    const std::string spec = "log:" + (folder_ / "jump.log");
    {
        auto bus = open_can_bus(spec, CanRole::client);
        ASSERT_TRUE(bus);
        for (const CanFrame& frame : {pose(0), pose(1), pose(2, 100'000'000'000'000), pose(2), pose(3)})
            (*bus)->send(frame);
    }
    std::vector<std::string> refusals;
    RunOptions o;
    o.bus = spec;
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    o.on_refusal = [&](const std::string& what) { refusals.push_back(what); };
    const auto emulator = ran(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(camera_of(*emulator).stats().frames, 4U);
    const std::string expected =
        "pose commands refused because they are for more than 60 s ahead (command_ahead_max_s in [render]): 1";
    EXPECT_EQ(refusals, std::vector{expected});
    EXPECT_EQ(emulator->notices(), std::vector{expected});
}

}  // namespace
}  // namespace narpa::test
