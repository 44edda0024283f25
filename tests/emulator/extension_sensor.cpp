// A new kind of sensor is one implementation of Sensor: the emulator runs a counter that exists only here, beside a
// camera, in lockstep and in real time.
#include <nlohmann/json.hpp>

#include "emulator/report.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

/// Counts every 30 ms and records when it did.
class Counter final : public Sensor {
public:
    static constexpr std::int64_t kPeriodNs = 30'000'000;

    std::string_view kind() const noexcept override { return "counter"; }
    std::string_view name() const noexcept override { return "ticks"; }
    SensorThread thread() const noexcept override { return {"narpa-counter", 40, false}; }
    std::vector<std::string> outputs() const override { return {"memory"}; }
    void start_at(std::int64_t t_ns) noexcept override { next_ = (t_ns + kPeriodNs - 1) / kPeriodNs; }
    std::int64_t last_pose_ns() const noexcept override { return next_ * kPeriodNs; }
    std::int64_t due_ns() const noexcept override { return last_pose_ns(); }
    void warm_up() override {
        ++warm_ups_;
        times_.reserve(1000);
    }
    void make_next(const Clock& clock) override {
        times_.push_back(clock.now_ns());
        ++next_;
    }
    Status finish() override {
        finished_ = true;
        return Ok{};
    }
    nlohmann::json report() const override { return {{"name", name()}, {"ticks", times_.size()}}; }
    std::string to_text(bool) const override {
        return "  counter " + std::string(name()) + ": " + std::to_string(times_.size()) + " ticks\n";
    }

    std::int64_t next_ = 0;
    std::vector<std::int64_t> times_;
    int warm_ups_ = 0;
    bool finished_ = false;
};

class JointSensor : public LoopTest {
protected:
    /// Runs a camera of 10 frames per second and the counter.
    std::unique_ptr<Emulator> run(const RunOptions& options) {
        auto emulator = Emulator::create(scene(small_scene()), options);
        if (!emulator) {
            ADD_FAILURE() << emulator.error().text();
            return nullptr;
        }
        (*emulator)->add_sensor(std::make_unique<Counter>());
        const StopFlag stop{false};
        EXPECT_TRUE((*emulator)->run(stop));
        return *std::move(emulator);
    }
    static const Counter& counter_of(const Emulator& emulator) { return *emulator.sensors_of<Counter>().front(); }
};

TEST_F(JointSensor, ACounterRunsInLockstep) {
    RunOptions o;
    o.bus = record(11);
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    const auto emulator = run(o);
    ASSERT_TRUE(emulator);
    const Counter& counter = counter_of(*emulator);
    EXPECT_EQ(camera_of(*emulator).stats().frames, 11U);  // 0.0, 0.1 ... 1.0 s
    ASSERT_EQ(counter.times_.size(), 34U);                // 0.00, 0.03 ... 0.99 s
    for (std::size_t i = 0; i < counter.times_.size(); ++i)
        EXPECT_EQ(counter.times_[i], static_cast<std::int64_t>(i) * Counter::kPeriodNs);
    EXPECT_EQ(counter.warm_ups_, 0);
    EXPECT_TRUE(counter.finished_);
}

TEST_F(JointSensor, ACounterRunsInRealTime) {
    RunOptions o;
    o.duration_s = 0.5;
    o.video = {{"nav", "none"}};
    const auto emulator = run(o);
    ASSERT_TRUE(emulator);
    const Counter& counter = counter_of(*emulator);
    ASSERT_EQ(counter.times_.size(), 17U);  // 0.00, 0.03 ... 0.48 s
    for (std::size_t i = 0; i < counter.times_.size(); ++i)
        EXPECT_GE(counter.times_[i], static_cast<std::int64_t>(i) * Counter::kPeriodNs);
    EXPECT_EQ(counter.warm_ups_, 1);
    EXPECT_TRUE(counter.finished_);
}

TEST_F(JointSensor, ACounterIsInTheReport) {
    RunOptions o;
    o.bus = record(4);
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    const auto emulator = run(o);
    ASSERT_TRUE(emulator);
    const nlohmann::json document = report(*emulator);
    EXPECT_EQ(document["counters"], nlohmann::json::parse(R"([{"name": "ticks", "ticks": 11}])"));
    EXPECT_EQ(document["cameras"].size(), 1U);
    EXPECT_NE(to_text(*emulator).find("counter ticks: 11 ticks"), std::string::npos) << to_text(*emulator);
}

}  // namespace
}  // namespace narpa::test
