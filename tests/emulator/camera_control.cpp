// A camera that is operated over CAN while it runs: settings act in the promised frame, triggers expose at their
// time, and every frame states what it was taken with.
#include "emulator/camera/camera_control.h"

#include <numeric>
#include <random>

#include "emulator/replay/replay.h"
#include "protocols/can/candump.h"
#include "renderer/camera/read_out.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

constexpr std::int64_t kMs = 1'000'000;

/// A run's answers and frames, as the bus had them.
struct Traffic {
    std::vector<CameraReply> replies;
    std::vector<CameraState> states;
    std::vector<FrameLedger> ledgers;
};

class CameraControlTest : public LoopTest {
protected:
    static std::string operated(const std::string& control = "control = {latency_s = 0.01}") {
        return "rate_hz = 20\nformat = \"GREY\"\n"
               "detector = {exposure_s = 0.002, full_well_e = 20000.0, shot_noise = true, read_noise_e = 5.0}\n" +
               control;
    }
    static std::string with_second_camera(std::string text) {
        const std::size_t at = text.find("[[camera]]"), end = text.find("[[lidar]]");
        std::string second = text.substr(at, end - at);
        second.replace(second.find("\"nav\""), 5, "\"aft\"");
        second.replace(second.find("[0.1, 0, 0]"), 11, "[0.1, 0.3, 0]");
        return text.insert(end, second);
    }

    void add(const CanFrame& frame) { ASSERT_TRUE(bus_->send(frame)); }
    void pose(int k) {
        CanFrame frame;
        ASSERT_TRUE(encode_fd(command(k), 0x100, frame));
        add(frame);
    }
    void open() {
        auto bus = open_can_bus(spec_, CanRole::client);
        ASSERT_TRUE(bus) << bus.error().text();
        bus_ = *std::move(bus);
    }

    /// Runs the scene over what was added to the bus.
    Traffic run(const std::string& scene_text, const std::vector<std::string>& cameras = {"nav"}) {
        bus_.reset();
        RunOptions o;
        o.bus = spec_;
        o.lockstep = true;
        o.log_folder = folder_ / "run";
        for (const std::string& camera : cameras) o.video.emplace_back(camera, folder_ / (camera + ".y4m").c_str());
        const auto emulator = ran(scene(scene_text), o);
        if (!emulator) return {};
        for (const CameraSensor* camera : emulator->cameras()) counters_.push_back(camera->control()->counters());
        for (const auto& [cause, n] : emulator->can()->counters().rejected())
            if (n > 0) rejected_[cause] = n;
        return read_traffic();
    }

    Traffic read_traffic() {
        Traffic traffic;
        std::ifstream in(folder_ / "run/can.log");
        MessageDecoder<CameraReply> replies;
        MessageDecoder<CameraState> states;
        std::array<LedgerDecoder, 2> ledgers{LedgerDecoder(0), LedgerDecoder(1)};
        for (std::string text; std::getline(in, text);) {
            CandumpLine line;
            if (parse_candump(text, line) != nullptr) continue;
            CameraReply reply;
            CameraState state;
            FrameLedger ledger;
            if (replies.accept(line.frame, line.t_ns, reply) == DecodeStatus::complete)
                traffic.replies.push_back(reply);
            if (states.accept(line.frame, line.t_ns, state) == DecodeStatus::complete)
                traffic.states.push_back(state);
            for (LedgerDecoder& decoder : ledgers)
                if (decoder.accept(line.frame, line.t_ns, ledger) == DecodeStatus::complete)
                    traffic.ledgers.push_back(ledger);
        }
        return traffic;
    }

    const std::string spec_ = "log:" + (folder_ / "commands.log");
    std::unique_ptr<CanBus> bus_;
    int poses_ = 0;
    std::vector<CameraControlCounters> counters_;
    std::map<std::string_view, std::uint64_t> rejected_;
};

CameraCommand random_command(std::mt19937& rng, int counter) {
    const auto below = [&](int limit) { return std::uniform_int_distribution(0, limit - 1)(rng); };
    CameraCommand c;
    c.counter = static_cast<std::uint8_t>(counter);
    if (below(2) == 0) c.exposure_ns = 10'000 + 1000 * below(50'000);  // some are too long
    if (below(2) == 0) c.gain_cdb = static_cast<std::int16_t>(below(2600));
    if (below(3) == 0) c.binning = static_cast<std::uint8_t>(below(5));
    if (below(3) == 0) c.period_ns = (40 + below(60)) * kMs;
    if (below(3) == 0) {
        c.region_x = static_cast<std::uint16_t>(below(40)), c.region_y = static_cast<std::uint16_t>(below(30));
        c.region_width = static_cast<std::uint16_t>(below(40)),
        c.region_height = static_cast<std::uint16_t>(below(30));
    }
    return c;
}

TEST_F(CameraControlTest, AThousandRandomChangesActInExactlyThePromisedFrame) {
    open();
    std::mt19937 rng(91);
    std::vector<CameraCommand> commands;
    for (int k = 0; k <= 1000; ++k) {
        pose(k);
        commands.push_back(random_command(rng, k));
        add(encode_fd(commands.back()));
    }
    const Traffic traffic = run(with_render(small_scene(operated()), "spp = 1"));
    ASSERT_EQ(traffic.replies.size(), commands.size());

    // What the answers promise.
    struct Promise {
        std::int64_t t_ns;
        std::uint8_t counter;
        CameraSettings settings;
    };
    std::vector<Promise> promises;
    CameraSettings latest = settings_of(scene(small_scene(operated())).cameras[0]);
    std::map<CameraAnswer, int> answers;
    for (std::size_t i = 0; i < commands.size(); ++i) {
        const CameraReply& r = traffic.replies[i];
        const CameraCommand& c = commands[i];
        EXPECT_EQ(r.counter, c.counter);
        ++answers[r.answer];
        if (r.answer != CameraAnswer::accepted) continue;
        CameraSettings& s = latest;
        s.exposure_ns = c.exposure_ns.value_or(s.exposure_ns), s.gain_cdb = c.gain_cdb.value_or(s.gain_cdb);
        s.binning = c.binning.value_or(s.binning), s.period_ns = c.period_ns.value_or(s.period_ns);
        s.region = {c.region_x.value_or(s.region.x), c.region_y.value_or(s.region.y),
                    c.region_width.value_or(s.region.width), c.region_height.value_or(s.region.height)};
        EXPECT_EQ(r.t_ns, static_cast<std::int64_t>(i) * 100 * kMs + 10 * kMs);
        promises.push_back({r.t_ns, r.counter, s});
    }
    for (const auto answer : {CameraAnswer::accepted, CameraAnswer::exposure_range, CameraAnswer::gain_range,
                              CameraAnswer::region_range, CameraAnswer::binning_range, CameraAnswer::period_range})
        EXPECT_GT(answers[answer], 10) << kCameraAnswers[static_cast<std::size_t>(answer)];

    ASSERT_EQ(traffic.states.size(), traffic.ledgers.size());
    EXPECT_GT(traffic.ledgers.size(), 1000U);
    CameraSettings in_effect = settings_of(scene(small_scene(operated())).cameras[0]);
    std::uint8_t counter = 0;
    auto next = promises.begin();
    std::int64_t t_mid_ns = traffic.ledgers.front().t_exposure_mid_ns;
    for (std::size_t i = 0; i < traffic.ledgers.size(); ++i) {
        for (; next != promises.end() && next->t_ns <= t_mid_ns - next->settings.exposure_ns / 2; ++next)
            in_effect = next->settings, counter = next->counter;
        const CameraState& state = traffic.states[i];
        ASSERT_EQ(state.frame, traffic.ledgers[i].frame);
        ASSERT_EQ(state.command_counter, counter) << "frame " << i;
        ASSERT_EQ(state.settings, in_effect) << "frame " << i;
        ASSERT_EQ(traffic.ledgers[i].t_exposure_mid_ns, t_mid_ns) << "frame " << i;
        t_mid_ns += in_effect.period_ns;
    }
    EXPECT_EQ(counters_[0].commands + counters_[0].commands_refused, commands.size());
}

/// The log has what each frame was taken with: a replay makes the same bytes.
TEST_F(CameraControlTest, ReplayRepeatsFramesOfChangingSettings) {
    open();
    std::mt19937 rng(92);
    for (int k = 0; k <= 30; ++k) {
        pose(k);
        add(encode_fd(random_command(rng, k)));
    }
    (void)run(small_scene(operated()));
    auto replay = Replay::open(folder_ / "run", "nav", "");
    ASSERT_TRUE(replay) << replay.error().text();
    ASSERT_GT((*replay)->frames().size(), 20U);
    for (std::size_t i = 0; i < (*replay)->frames().size(); ++i)
        EXPECT_TRUE((*replay)->make(i).empty()) << "frame " << i << ": " << (*replay)->make(i).front();
}

/// The scene's exposure is 0.3 ns more than a log has; no command ever changes it.
TEST_F(CameraControlTest, ReplayRepeatsFramesBeforeTheFirstCommand) {
    open();
    for (int k = 0; k <= 3; ++k) pose(k);
    std::string text = operated();
    text.replace(text.find("0.002"), 5, "0.0020000003");
    (void)run(small_scene(text));
    auto replay = Replay::open(folder_ / "run", "nav", "");
    ASSERT_TRUE(replay) << replay.error().text();
    ASSERT_FALSE((*replay)->frames().empty());
    for (std::size_t i = 0; i < (*replay)->frames().size(); ++i)
        EXPECT_TRUE((*replay)->make(i).empty()) << "frame " << i;
}

TEST_F(CameraControlTest, ReplayRefusesARegionOutsideTheImage) {
    open();
    for (int k = 0; k <= 3; ++k) pose(k);
    (void)run(small_scene(operated()));
    const std::string ledger = folder_ / "run/nav.ledger.csv";
    std::string text = read_text(ledger);
    text.replace(text.find(",64,48,"), 7, ",65,48,");
    std::ofstream(ledger) << text;
    const auto replay = Replay::open(folder_ / "run", "nav", "");
    ASSERT_FALSE(replay);
    EXPECT_NE(replay.error().text().find("nav.ledger.csv:2:1: frame 0: a region of 65 x 48 at (0, 0)"),
              std::string::npos)
        << replay.error().text();
}

TEST_F(CameraControlTest, OneTriggerExposesAllItsCamerasAtTheSameNanosecond) {
    open();
    constexpr int kTriggers = 6000;  // 10 minutes at 10 Hz
    for (int k = 0; k <= kTriggers; ++k) {
        pose(k);
        // An odd part of a nanosecond grid, 20 ms ahead or at once.
        CameraTrigger t{static_cast<std::uint8_t>(k), 0b11, k % 2 == 0, k * 100 * kMs + 20 * kMs + k * 7 + 1};
        if (k < kTriggers) add(encode_fd(t));
    }
    std::string text = with_second_camera(small_scene(operated("control = {trigger = \"command\"}")));
    text.replace(text.rfind("exposure_s = 0.002"), 18, "exposure_s = 0.005");
    const Traffic traffic = run(with_render(with_resolution(text, "[32, 24]"), "spp = 1"), {"nav", "aft"});
    ASSERT_EQ(traffic.replies.size(), 2U * kTriggers);
    std::array<std::vector<std::int64_t>, 2> starts;
    for (const FrameLedger& l : traffic.ledgers) starts[l.camera].push_back(l.t_exposure_mid_ns);
    ASSERT_EQ(starts[0].size(), static_cast<std::size_t>(kTriggers));
    ASSERT_EQ(starts[1].size(), static_cast<std::size_t>(kTriggers));
    for (std::size_t i = 0; i < kTriggers; ++i) {
        const CameraReply &nav = traffic.replies[2 * i], &aft = traffic.replies[2 * i + 1];
        ASSERT_EQ(nav.answer, CameraAnswer::accepted);
        ASSERT_EQ(nav.t_ns, aft.t_ns);  // the skew
        ASSERT_EQ(starts[0][i], nav.t_ns + 1 * kMs);
        ASSERT_EQ(starts[1][i], aft.t_ns + 2'500'000);
    }
    EXPECT_EQ(counters_[0].triggers, static_cast<std::uint64_t>(kTriggers));
    EXPECT_EQ(counters_[0].triggers_dropped + counters_[0].triggers_refused, 0U);
}

TEST_F(CameraControlTest, SyncExposesAfterTheLatency) {
    open();
    CanFrame sync;
    sync.id = kSyncId;
    for (int k = 0; k <= 20; ++k) pose(k), add(sync);
    const Traffic traffic = run(small_scene(operated("control = {trigger = \"sync\", latency_s = 0.003}")));
    ASSERT_EQ(traffic.ledgers.size(), 20U);  // the last has no pose yet
    for (std::size_t i = 0; i < traffic.ledgers.size(); ++i)
        EXPECT_EQ(traffic.ledgers[i].t_exposure_mid_ns, static_cast<std::int64_t>(i) * 100 * kMs + 4 * kMs);
}

TEST_F(CameraControlTest, StopsStartsAndChangesItsTrigger) {
    open();
    const auto at = [&](int k, CameraCommand c) {
        static int counter = 0;
        c.counter = static_cast<std::uint8_t>(++counter);
        while (poses_ <= k) pose(poses_++);
        add(encode_fd(c));
    };
    CameraCommand stop, start, by_command, free;
    stop.running = false, start.running = true;
    by_command.trigger = TriggerMode::command, free.trigger = TriggerMode::free_running;
    at(10, stop);        // 1 s
    at(20, start);       // 2 s
    at(30, by_command);  // 3 s
    while (poses_ <= 33) pose(poses_++);
    add(encode_fd(CameraTrigger{1, 1, false, 3'400 * kMs}));
    add(encode_fd(CameraTrigger{2, 1, false, 3'420 * kMs}));  // within the period after it
    add(encode_fd(CameraTrigger{3, 1, false, 3'305 * kMs}));  // within the latency
    at(40, free);
    while (poses_ <= 45) pose(poses_++);
    add(encode_fd(CameraTrigger{4, 1, true, 0}));
    const Traffic traffic = run(small_scene(operated()));
    std::vector<std::int64_t> wanted;
    for (std::int64_t t = 0; t <= 1000; t += 50) wanted.push_back(t * kMs);
    for (std::int64_t t = 2010; t < 3005; t += 50) wanted.push_back((t + 1) * kMs);
    wanted.push_back(3'401 * kMs);
    for (std::int64_t t = 4010; t <= 4499; t += 50) wanted.push_back((t + 1) * kMs);
    std::vector<std::int64_t> got;
    for (const FrameLedger& l : traffic.ledgers) got.push_back(l.t_exposure_mid_ns);
    EXPECT_EQ(got, wanted);
    std::vector<CameraAnswer> answers;
    for (const CameraReply& r : traffic.replies)
        if (r.to_trigger) answers.push_back(r.answer);
    EXPECT_EQ(answers, (std::vector{CameraAnswer::accepted, CameraAnswer::too_soon, CameraAnswer::too_soon,
                                    CameraAnswer::wrong_mode}));
}

TEST_F(CameraControlTest, AutoExposureReachesItsLevel) {
    open();
    for (int k = 0; k <= 30; ++k) pose(k);
    const Traffic dark = run(small_scene(operated("control = {auto_exposure = true, auto_exposure_level = 0.2}")));
    ASSERT_GT(dark.states.size(), 40U);
    EXPECT_NE(dark.states.front().settings.exposure_ns, dark.states.back().settings.exposure_ns);
    const std::string video = read_text(folder_ / "nav.y4m");
    const std::size_t size = 64 * 48;
    const std::span last(reinterpret_cast<const std::uint8_t*>(video.data()) + video.size() - size, size);
    EXPECT_NEAR(mean_level({64, 48, PixelFormat::grey}, {0, 0, 64, 48}, last), 0.2, 0.01);
}

TEST_F(CameraControlTest, SpoiltCommandsAndTriggersAreCounted) {
    open();
    pose(0);
    CanFrame command = encode_fd(CameraCommand{}), trigger = encode_fd(CameraTrigger{9, 1, true, 0});
    command.data[9] ^= 0x40;
    add(command);
    trigger.size = 8;
    add(trigger);
    add(trigger);
    pose(1);
    EXPECT_TRUE(run(small_scene(operated())).replies.empty());
    EXPECT_EQ(rejected_, (std::map<std::string_view, std::uint64_t>{{"bad_checksum", 1}, {"too_short", 2}}));
}

TEST_F(CameraControlTest, CommandsThatCannotBeAreAnswered) {
    open();
    pose(0);
    CameraCommand other, exposure;
    other.camera = 3, other.gain_cdb = 0;
    exposure.exposure_ns = kMs;
    add(encode_fd(other));
    add(encode_fd(exposure));
    add(encode_fd(CameraTrigger{9, 0b101, true, 0}));
    pose(1);
    const Traffic traffic = run(small_scene(operated("control = {auto_exposure = true}")));
    std::vector<CameraAnswer> answers;
    for (const CameraReply& r : traffic.replies) answers.push_back(r.answer);
    EXPECT_EQ(answers, (std::vector{CameraAnswer::not_controllable, CameraAnswer::auto_exposure,
                                    CameraAnswer::wrong_mode, CameraAnswer::not_controllable}));
}

TEST_F(CameraControlTest, ValuesThatNoCameraHasAreAnswered) {
    open();
    pose(0);
    std::uint8_t counter = 0;
    for (const auto& [signal, value] : std::initializer_list<std::pair<std::size_t, std::int64_t>>{
             {6, -1}, {7, -5}, {9, 70'000}, {4, -1}, {5, -1}, {11, -1}, {1, 2}, {2, 4}, {3, -1}}) {
        RawSignals raw{};
        for (std::size_t i = 1; i < kCameraCommandLayout.signals.size(); ++i) raw[i] = kNotAvailable;
        raw[signal] = value;
        add(encode_fd(kCameraCommandLayout, raw, ++counter, kCameraCommandBaseId));
    }
    RawSignals trigger{};
    trigger[0] = 0b101, trigger[1] = 2;  // at once: unknown
    add(encode_fd(kCameraTriggerLayout, trigger, ++counter, kCameraTriggerBaseId));
    pose(1);
    const Traffic traffic = run(small_scene(operated()));
    std::vector<CameraAnswer> answers;
    for (const CameraReply& r : traffic.replies) answers.push_back(r.answer);
    using enum CameraAnswer;
    EXPECT_EQ(answers,
              (std::vector{exposure_range, region_range, region_range, binning_range, gain_range, period_range,
                           wrong_mode, wrong_mode, wrong_mode, wrong_mode, not_controllable}));
    ASSERT_EQ(traffic.replies.size(), 11U);
    EXPECT_EQ(traffic.replies[0].counter, 1);
    EXPECT_EQ(traffic.replies[6].counter, 7);
    EXPECT_TRUE(traffic.replies[9].to_trigger);
    EXPECT_EQ(traffic.replies[10].camera, 2);
}

// --- Its schedule, without a loop -------------------------------------

class CameraSchedule : public testing::Test {
protected:
    static Camera camera(CameraControlLimits limits) {
        Camera c;
        c.width = 64, c.height = 48;
        c.period_ns = 50 * kMs;
        c.detector = Detector{};
        c.detector->exposure_s = 0.002;
        limits.exposure_max_ns = 400 * kMs;
        c.control = limits;
        return c;
    }
    /// Answered as it should be.
    static void expect_accepted(const CameraReply& reply) { EXPECT_EQ(reply.answer, CameraAnswer::accepted); }
};

TEST_F(CameraSchedule, ATriggerFarAheadIsForgottenWithItsMode) {
    for (const bool planned_between : {true, false}) {
        SCOPED_TRACE(planned_between);
        CameraControl control(camera({.trigger = TriggerMode::command}), 0);
        CameraCommand free, by_command;
        free.trigger = TriggerMode::free_running, by_command.trigger = TriggerMode::command;
        expect_accepted(control.trigger({1, 1, false, 1'000'000 * kMs}, 0));
        expect_accepted(control.command(free, 100 * kMs));
        if (planned_between) control.plan();
        expect_accepted(control.command(by_command, 200 * kMs));
        expect_accepted(control.trigger({2, 1, false, 1000 * kMs}, 300 * kMs));
        control.plan();
        while (control.t_start_ns() < 300 * kMs) control.advance({});
        EXPECT_EQ(control.t_start_ns(), 1000 * kMs);
        control.advance({});
        EXPECT_EQ(control.t_start_ns(), Clock::kNever);
        EXPECT_EQ(control.counters().triggers_dropped, 1U);
    }
}

TEST_F(CameraSchedule, ExposuresNeverOverlapWhenThePeriodGetsShorter) {
    CameraControl control(camera({.auto_exposure = true}), 0);
    CameraCommand slow, fast;
    slow.period_ns = 500 * kMs, fast.period_ns = 50 * kMs;
    expect_accepted(control.command(slow, 0));
    std::int64_t ended_ns = -kMs - 1;
    for (int frame = 0; frame < 100; ++frame) {
        control.plan();
        EXPECT_GT(control.t_start_ns(), ended_ns) << frame;
        ended_ns = control.t_start_ns() + control.settings().exposure_ns;
        if (frame == 50) expect_accepted(control.command(fast, control.t_start_ns()));
        control.advance(0.001);  // dark: the exposure doubles to its limit
    }
    EXPECT_EQ(control.settings().period_ns, 50 * kMs);
    EXPECT_EQ(control.settings().exposure_ns, 50 * kMs - 1);
}

// --- Read-out -------------------------------------------------------

TEST(ReadOut, OutsideTheRegionIsBlackAndBlocksHaveTheirMean) {
    std::vector<std::uint8_t> bytes(8 * 6);
    std::iota(bytes.begin(), bytes.end(), std::uint8_t{1});
    const std::vector<std::uint8_t> before = bytes;
    read_out({8, 6, PixelFormat::grey}, {1, 1, 5, 4}, 2, bytes);
    for (std::size_t y = 0; y < 6; ++y)
        for (std::size_t x = 0; x < 8; ++x) {
            const bool inside = x >= 1 && x < 6 && y >= 1 && y < 5;
            unsigned wanted = 0;
            if (inside) {
                const std::size_t left = 1 + (x - 1) / 2 * 2, top = 1 + (y - 1) / 2 * 2;
                const std::size_t right = std::min<std::size_t>(left + 2, 6);
                unsigned sum = 0, n = 0;
                for (std::size_t v = top; v < top + 2; ++v)
                    for (std::size_t u = left; u < right; ++u) sum += before[v * 8 + u], ++n;
                wanted = (sum + n / 2) / n;
            }
            EXPECT_EQ(bytes[y * 8 + x], wanted) << x << ", " << y;
        }
    std::vector<std::uint8_t> pairs(8 * 2 * 2, 77);
    read_out({8, 2, PixelFormat::yuyv}, {2, 0, 4, 1}, 1, pairs);
    EXPECT_EQ(pairs[0], 16);
    EXPECT_EQ(pairs[1], 128);
    EXPECT_EQ(pairs[4], 77);
    EXPECT_EQ(pairs[12], 16);
}

TEST(ReadOut, SixteenBitSamplesAreWhole) {
    std::vector<std::uint8_t> bytes{0xFF, 0x00, 0x01, 0x01, 0xFF, 0x00, 0x01, 0x01};  // 255, 257 twice
    read_out({2, 2, PixelFormat::y16}, {0, 0, 2, 2}, 2, bytes);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(bytes[2 * i] + 256 * bytes[2 * i + 1], 256);
}

}  // namespace
}  // namespace narpa::test
