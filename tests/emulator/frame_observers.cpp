// Observers of frames: any number of a camera, each with its part of the report; a busy one delays nobody.
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "emulator/report.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

class Recorder final : public FrameObserver {
public:
    explicit Recorder(std::string name) : name_(std::move(name)) {}
    std::string_view name() const noexcept override { return name_; }
    std::string description() const override { return name_; }
    std::size_t camera() const noexcept override { return 0; }
    Status log_to(const std::string& folder, bool) override {
        std::ofstream(folder + "/" + name_ + ".txt") << "log\n";
        return Ok{};
    }
    void observe(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) override {
        frames.push_back(ledger.frame);
        bytes_seen = bytes.size();
        x_m = at.T_world_body[1].t.x;
    }
    Status finish() override {
        finished = true;
        return Ok{};
    }
    nlohmann::json report(std::uint64_t skipped) const override {
        return {{"frames", frames.size()}, {"skipped", skipped}, {"finished", finished}};
    }
    std::string to_text(std::uint64_t) const override { return "  " + name_ + "\n"; }

    std::vector<std::uint32_t> frames;
    std::size_t bytes_seen = 0;
    double x_m = 0;  ///< of the chaser
    bool finished = false;

private:
    std::string name_;
};

OpenFrameObserver record_as(const std::string& name, const Recorder** made = nullptr) {
    return [=](const World&, std::span<const std::size_t> cameras, bool) -> Result<std::unique_ptr<FrameObserver>> {
        if (cameras.empty()) return Error{"no camera"};
        auto recorder = std::make_unique<Recorder>(name);
        if (made) *made = recorder.get();
        return std::unique_ptr<FrameObserver>(std::move(recorder));
    };
}

class FrameObservers : public LoopTest {};

TEST_F(FrameObservers, TwoOfOneCameraGetEveryFrameOfALockstepRun) {
    RunOptions o;
    o.bus = record(6);
    o.lockstep = true;
    o.log_folder = folder_ / "log";
    o.video = {{"nav", "none"}};
    const Recorder* first = nullptr;
    o.observers = {record_as("first", &first), record_as("second")};
    const auto emulator = ran(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(first->frames, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(first->bytes_seen, camera_of(*emulator).unit().bytes().size());
    EXPECT_NEAR(first->x_m, -10 + 0.5 * 0.5, 1e-9);
    const nlohmann::json document = report(*emulator), all{{"frames", 6}, {"skipped", 0}, {"finished", true}};
    EXPECT_EQ(document["first"], all);
    EXPECT_EQ(document["second"], all);
    EXPECT_NE(to_text(*emulator).find("  first\n  second\n"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(folder_ / "log/second.txt"));
}

TEST_F(FrameObservers, OneWithoutACameraIsRefused) {
    RunOptions o;
    o.lidar = {{"top", "none"}};
    o.observers = {record_as("first")};
    const auto emulator = Emulator::create(scene(small_scene()), o);
    ASSERT_FALSE(emulator);
    EXPECT_EQ(emulator.error().what, "no camera");
}

TEST_F(FrameObservers, FramesThatComeWhileOneIsBusyAreSkipped) {
    const auto world = World::create(scene(small_scene()));
    ASSERT_TRUE(world);
    auto made = std::make_unique<Recorder>("first");
    const Recorder& recorder = *made;
    FrameFeed feed(std::move(made), **world, false);
    const CameraUnit unit(**world, 0);
    const BodyPoses at(2);
    FrameLedger ledger;
    for (ledger.frame = 0; ledger.frame < 3; ++ledger.frame) feed.take(ledger, unit.bytes(), at);
    EXPECT_EQ(feed.skipped(), 2U);
    EXPECT_TRUE(recorder.frames.empty()) << "its own thread is to observe";
    StopFlag stop{false};
    std::thread thread([&] { feed.run(stop); });
    std::uint64_t before = 0;
    do {
        std::this_thread::yield();
        before = feed.skipped();
        feed.take(ledger, unit.bytes(), at);
    } while (feed.skipped() > before);  // until it is taken: the first one has been observed
    stop = true;
    feed.wake();
    thread.join();
    ASSERT_FALSE(recorder.frames.empty());
    EXPECT_EQ(recorder.frames.front(), 0U);
}

}  // namespace
}  // namespace narpa::test
