// The MCAP file of a run: its messages against the run's own logs, the same bytes each time, drops in real time.
#include "emulator/log/mcap_log.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "emulator/report.h"
#include "tests/emulator/loop_support.h"
#include "tests/protocols/mcap_reader.h"
#include "tests/protocols/protobuf_reader.h"
#include "tests/support/allocation_counter.h"

namespace narpa::test {
namespace {

class McapLogs : public LoopTest {
protected:
    RunOptions lockstep(const std::string& name) {
        RunOptions o;
        o.bus = record(6);
        o.lockstep = true;
        o.log_folder = folder_ / name;
        o.mcap = folder_ / (name + ".mcap");
        o.video = {{"nav", folder_ / (name + ".y4m")}};
        o.lidar = {{"top", "none"}};
        return o;
    }
};

TEST_F(McapLogs, ARunInLockstepHasEveryFrameAndSweepOfItsLogs) {
    const RunOptions o = lockstep("a");
    const auto emulator = ran(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    const auto file = read_bytes(o.mcap);
    const McapFileRead read = read_mcap(file);
    EXPECT_EQ(read.metadata.at("scene"), "small");
    EXPECT_EQ(read.counted, read.messages.size());
    EXPECT_EQ(read.indexed, read.messages.size());
    const auto ledger = read_rows(o.log_folder + "/nav.ledger.csv"),
               sweeps = read_rows(o.log_folder + "/top.sweeps.csv");
    EXPECT_EQ(read.count("/camera/nav/image"), ledger.size());
    EXPECT_EQ(read.count("/camera/nav/ledger"), ledger.size());
    EXPECT_EQ(read.count("/camera/nav/calibration"), ledger.size());
    EXPECT_EQ(read.count("/lidar/top/points"), sweeps.size());
    EXPECT_EQ(read.count("/tf"), ledger.size() + sweeps.size());
    EXPECT_EQ(read.count("/log"), 0U);

    std::size_t frame = 0, sweep = 0;
    for (const McapMessageRead& m : read.messages) {
        if (m.topic == "/camera/nav/image") {
            const auto& row = ledger.at(frame++);
            EXPECT_EQ(std::to_string(m.log_ns), row.at("t_exposure_mid_ns"));
            EXPECT_EQ(std::to_string(m.publish_ns), row.at("t_hand_over_ns"));
            const ProtoFields image = read_proto(m.data);
            const auto& pixels = image.find(6)->second.bytes;
            EXPECT_EQ(fmt::format("{:08x}", ::crc32_z(0, pixels.data(), pixels.size())), row.at("image_crc32"));
            EXPECT_EQ(text_of(image.find(4)->second), "mono8");
        } else if (m.topic == "/lidar/top/points") {
            const auto& row = sweeps.at(sweep++);
            EXPECT_EQ(std::to_string(m.log_ns), row.at("t_first_shot_ns"));
            const ProtoFields cloud = read_proto(m.data);
            const std::uint64_t stride = cloud.find(4)->second.number;
            const auto data = cloud.find(6);
            const std::size_t size = data == cloud.end() ? 0 : data->second.bytes.size();
            EXPECT_EQ(std::to_string(size / stride), row.at("returns"));
        }
    }
    const nlohmann::json document = report(*emulator)["mcap"];
    EXPECT_EQ(document["messages"], read.messages.size());
    EXPECT_EQ(document["bytes"], file.size());
    EXPECT_EQ(document["dropped"], 0);
}

TEST_F(McapLogs, TheSameRunInLockstepGivesTheSameBytes) {
    const RunOptions a = lockstep("a"), b = lockstep("b");
    ASSERT_TRUE(ran(scene(small_scene()), a));
    ASSERT_TRUE(ran(scene(small_scene()), b));
    EXPECT_EQ(read_bytes(a.mcap), read_bytes(b.mcap));
}

TEST_F(McapLogs, InRealTimeEachFrameIsInTheFileOrCounted) {
    RunOptions o;
    o.duration_s = 0.5;
    o.mcap = folder_ / "a.mcap";
    o.video = {{"nav", "none"}};
    o.lidar = {{"top", "none"}};
    const auto emulator = ran(scene(small_scene()), o);
    ASSERT_TRUE(emulator);
    const McapFileRead read = read_mcap(read_bytes(o.mcap));
    const std::uint64_t dropped = report(*emulator)["mcap"]["dropped"];
    const CameraStats& stats = camera_of(*emulator).stats();
    EXPECT_LE(read.count("/camera/nav/ledger"), stats.frames);
    EXPECT_GE(read.count("/camera/nav/ledger") + dropped, stats.frames);
    EXPECT_GT(read.count("/lidar/top/points"), 0U);
}

TEST_F(McapLogs, AFullQueueDropsWithoutWaitingOrAllocating) {
    const auto world = World::create(scene(with_resolution(small_scene(), "[1600, 1200]")));
    ASSERT_TRUE(world);
    const std::vector<std::size_t> first{0};
    auto log = McapLog::create(folder_ / "a.mcap", (*world)->scene(), first, {}, false);
    ASSERT_TRUE(log);
    McapSource& source = (*log)->source_of_camera(0);
    const std::vector<std::uint8_t> pixels(1600UL * 1200UL, 7);
    const BodyPoses at(2);
    constexpr std::uint32_t kFrames = 500;
    FrameLedger ledger;
    if (!kAllocationsAreCounted) GTEST_SKIP() << "allocations are not counted";
    const AllocationCounter counter;
    for (ledger.frame = 0; ledger.frame < kFrames; ++ledger.frame) {
        ledger.t_exposure_mid_ns = ledger.frame * 1'000'000LL;
        source.frame(ledger, pixels, at);
    }
    EXPECT_EQ(counter.on_this_thread(), 0U);
    ASSERT_TRUE((*log)->close());
    const McapFileRead read = read_mcap(read_bytes(folder_ / "a.mcap"));
    EXPECT_EQ(read.count("/camera/nav/image") + (*log)->dropped(), kFrames);
    EXPECT_GT((*log)->dropped(), 0U) << "no disk takes 1 GB as fast as memory";
    EXPECT_GT(read.count("/log"), 0U) << "the drops are told";
}

TEST_F(McapLogs, AFileThatCannotBeWrittenIsAnErrorBeforeTheRun) {
    RunOptions o;
    o.mcap = folder_ / "none/a.mcap";
    o.video = {{"nav", "none"}};
    const auto emulator = Emulator::create(scene(small_scene()), o);
    ASSERT_FALSE(emulator);
    EXPECT_EQ(emulator.error().file, o.mcap);
}

TEST(McapMessages, EncodingsAreThoseOfFoxgloveAndRos) {
    EXPECT_EQ(image_encoding(PixelFormat::grey), "mono8");
    EXPECT_EQ(image_encoding(PixelFormat::y16), "mono16");
    EXPECT_EQ(image_encoding(PixelFormat::yuyv), "yuyv");
    EXPECT_EQ(image_encoding(PixelFormat::rgb24), "rgb8");
    EXPECT_EQ(image_encoding(PixelFormat::grbg8), "bayer_grbg8");
    EXPECT_EQ(image_encoding(PixelFormat::bggr16), "bayer_bggr16");
}

}  // namespace
}  // namespace narpa::test
