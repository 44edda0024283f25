// A new kind of sensor with a CAN message of its own is one file: the descriptions below give its bytes, its DBC,
// its schedule and its place in the report. The emulator runs it beside a camera, in lockstep and in real time.
#include <nlohmann/json.hpp>
#include <thread>

#include "base/spsc_ring.h"
#include "emulator/bus/can_node.h"
#include "emulator/report.h"
#include "protocols/can/dbc.h"
#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"

namespace narpa {

// --- The message: what it says, and where on the wire
// --------------------------------------------------------------

struct TickReport {
    std::uint8_t counter = 0;
    std::int64_t t_ns = 0;
    std::uint32_t ticks = 0;
    double rate_hz = 0;
};

inline constexpr std::array<std::string_view, 2> kTickFrames{"TickTime", "TickCount"};
inline constexpr auto kTickSignals = place_fd_signals(std::to_array<Signal>({
    {"Time", "ns", "Simulation clock modulo 2^48 ns", 1, false, {0, 0, 48}},
    {"Ticks", "", "Since the start", 1, false, {1, 0, 32}},
    {"Rate", "Hz", "Ticks a second", 100, true, {1, 32, 16}},
}));
inline constexpr SetLayout kTickLayout =
    describe_set("Tick", "tick", "What a counter counts", 0x7B0, kFromNarpa, kTickFrames, kTickSignals);

template <>
struct Codec<TickReport> {
    static constexpr const SetLayout& layout = kTickLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.t_ns, m.ticks, m.rate_hz); }
};

namespace test {
namespace {

// --- The sensor
// -----------------------------------------------------------------------------------------------------

/// Counts every 30 ms and reports it on CAN.
class Counter final : public Sensor {
public:
    static constexpr std::int64_t kPeriodNs = 30'000'000;

    std::string_view kind() const noexcept override { return "counter"; }
    std::string_view name() const noexcept override { return "ticks"; }
    SensorThread thread() const noexcept override { return {"narpa-counter", 40, false}; }
    std::vector<std::string> outputs() const override { return {"CAN"}; }
    void start_at(std::int64_t t_ns) noexcept override { next_ = (t_ns + kPeriodNs - 1) / kPeriodNs; }
    std::int64_t last_pose_ns() const noexcept override { return next_ * kPeriodNs; }
    std::int64_t due_ns() const noexcept override { return last_pose_ns(); }
    void warm_up() override { ++warm_ups_; }
    void make_next(const Clock& clock) override {
        early_ += clock.now_ns() < due_ns();
        (void)reports_.push({0, due_ns(), static_cast<std::uint32_t>(++made_), 1e9 / kPeriodNs});
        ++next_;
    }
    void send_telemetry(CanNode& can, std::int64_t t_ns, Heartbeat&) noexcept override {
        for (TickReport r; reports_.pop(r);) can.send_numbered(r, t_ns);
    }
    std::uint64_t made() const noexcept override { return made_; }
    Status finish() override {
        finished_ = true;
        return Ok{};
    }
    nlohmann::json report() const override {
        return {{"ticks", made_}, {"early", early_}, {"warm_ups", warm_ups_}, {"finished", finished_}};
    }
    std::string to_text(bool) const override { return "  counter: " + std::to_string(made_) + " ticks\n"; }

private:
    std::int64_t next_ = 0;
    std::uint64_t made_ = 0;
    int early_ = 0, warm_ups_ = 0;
    bool finished_ = false;
    SpscRing<TickReport, 64> reports_;
};

Status open_counter(const World&, const RunOptions&, OpenSensors& out) {
    out.all.push_back(std::make_unique<Counter>());
    return Ok{};
}

/// The shipped kinds and this one.
std::span<const SensorKind> kinds() {
    static const std::vector<SensorKind> all = [] {
        std::vector<SensorKind> rows(sensor_kinds().begin(), sensor_kinds().end());
        rows.push_back({"counter", open_counter});
        return rows;
    }();
    return all;
}

class ExtensionSensor : public LoopTest {
protected:
    std::unique_ptr<Emulator> open(RunOptions o) {
        o.video = {{"nav", "none"}};
        auto emulator = Emulator::create(scene(small_scene()), o, kinds());
        if (emulator) return *std::move(emulator);
        ADD_FAILURE() << emulator.error().text();
        return nullptr;
    }
    const StopFlag stop_{false};
};

TEST_F(ExtensionSensor, RunsInLockstepAndReportsOnCan) {
    RunOptions o;
    o.bus = "slcan:0";
    o.lockstep = true;
    o.duration_s = 1;
    const auto emulator = open(o);
    ASSERT_TRUE(emulator);
    StopFlag stop{false};
    std::thread loop([&] { EXPECT_TRUE(emulator->run(stop)); });
    const auto client = open_or_fail("slcan:" + std::to_string(hub_port(emulator->can()->bus())), CanRole::client);
    for (int k = 0; client && k <= 11; ++k) {
        FrameSet pose;
        EXPECT_TRUE(encode_classic(command(k), 0x100, pose));
        for (const CanFrame& frame : pose) EXPECT_TRUE(client->send(frame));
    }
    stop = !client;
    loop.join();
    ASSERT_TRUE(client);

    MessageDecoder<TickReport> decoder;
    std::vector<TickReport> ticks;
    TickReport tick;
    for (int i = 0; i < 100 && ticks.size() < 34; ++i) {
        client->wait(100'000'000);
        for (ReceivedFrame got; client->receive(got);)
            if (decoder.accept(got.frame, 0, tick) == DecodeStatus::complete) ticks.push_back(tick);
    }
    ASSERT_EQ(ticks.size(), 34U);  // 0.00, 0.03 ... 0.99 s
    for (std::size_t i = 0; i < ticks.size(); ++i) {
        EXPECT_EQ(ticks[i].counter, i);
        EXPECT_EQ(ticks[i].t_ns, static_cast<std::int64_t>(i) * Counter::kPeriodNs);
        EXPECT_EQ(ticks[i].ticks, i + 1);
        EXPECT_NEAR(ticks[i].rate_hz, 33.33, 1e-9);
    }
    EXPECT_EQ(camera_of(*emulator).stats().frames, 10U);  // 0.0, 0.1 ... 0.9 s
}

TEST_F(ExtensionSensor, RunsInRealTimeAndIsInTheReport) {
    RunOptions o;
    o.duration_s = 0.5;
    const auto emulator = open(o);
    ASSERT_TRUE(emulator);
    EXPECT_TRUE(emulator->run(stop_));
    const nlohmann::json document = report(*emulator);
    EXPECT_EQ(document["counters"],  // 0.00, 0.03 ... 0.48 s
              nlohmann::json::parse(R"([{"ticks": 17, "early": 0, "warm_ups": 1, "finished": true}])"));
    EXPECT_EQ(document["cameras"].size(), 1U);
    EXPECT_EQ(document["lidars"].size(), 0U);
    EXPECT_NE(to_text(*emulator).find("counter: 17 ticks"), std::string::npos) << to_text(*emulator);
}

TEST(ExtensionMessage, BothFormsCarryTheSame) {
    const TickReport sent{7, 123'456'789'012, 4'000'000'000, 12.34};
    MessageDecoder<TickReport> classic, fd;
    TickReport a, b;
    DecodeStatus status{};
    for (const CanFrame& frame : encode_classic(sent)) status = classic.accept(frame, sent.t_ns, a);
    EXPECT_EQ(status, DecodeStatus::complete);
    EXPECT_EQ(fd.accept(encode_fd(sent), sent.t_ns, b), DecodeStatus::complete);
    for (const TickReport& got : {a, b}) {
        EXPECT_EQ(got.counter, sent.counter);
        EXPECT_EQ(got.t_ns, sent.t_ns);
        EXPECT_EQ(got.ticks, sent.ticks);
        EXPECT_EQ(got.rate_hz, sent.rate_hz);
    }
}

TEST(ExtensionMessage, IsInTheDbc) {
    const SetLayout* const row = &kTickLayout;
    const std::string dbc = write_dbc({}, 0, {&row, 1});
    for (const char* line :
         {"BO_ 1968 TickTime: 8 narpa\n", "BO_ 1969 TickCount: 8 narpa\n",
          " SG_ Rate : 32|16@1- (0.01,0) [-327.67|327.67] \"Hz\" Commander\n", "BO_ 1983 Tick: 64 narpa\n",
          " SG_ Rate : 80|16@1- (0.01,0)", " SG_ Counter : 96|8@1+ (1,0) [0|255] \"\" Commander\n",
          "CM_ SG_ 1969 Ticks \"Since the start\";\n", "BA_ \"VFrameFormat\" BO_ 1983 14;\n"})
        EXPECT_NE(dbc.find(line), std::string::npos) << line << "is not in\n" << dbc;
}

}  // namespace
}  // namespace test
}  // namespace narpa
