// What a logged run writes of its LiDAR: a row for each sweep, and one for each shot where it is wanted.
#include <zlib.h>

#include <cmath>

#include "drivers/lidar/capture.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

using Rows = std::vector<std::map<std::string, std::string>>;

class SweepLogs : public LoopTest {
protected:
    /// Two seconds in lockstep: the LiDAR's log is in NAME, its packets in NAME.pcap.
    void run(const std::string& name, int threads, bool shots, const std::string& lidar_keys = "") {
        RunOptions o;
        o.bus = record(21);
        o.lockstep = true;
        o.threads = threads;
        o.log_folder = folder_ / name.c_str();
        o.log_shots = shots;
        o.lidar = {{"top", o.log_folder + ".pcap"}};
        std::string text = small_scene();
        text.replace(text.find("rate_hz = 10\n[render]"), 12, "rate_hz = 10\n" + lidar_keys);
        const auto emulator = ran(scene(text), o);
        ASSERT_TRUE(emulator);
        packets_ = lidar_of(*emulator).stats().packets;
    }
    static std::int64_t whole(const std::map<std::string, std::string>& row, const char* column) {
        return std::stoll(row.at(column));
    }
    std::uint64_t packets_ = 0;
};

TEST_F(SweepLogs, HaveARowForEachSweepWithTheChecksumOfItsPackets) {
    run("one", 1, false);
    EXPECT_FALSE(std::ifstream(folder_ / "one/top.shots.csv")) << "only where it is wanted";
    const Rows sweeps = read_rows(folder_ / "one/top.sweeps.csv");
    auto capture = read_capture(folder_ / "one.pcap");
    ASSERT_TRUE(capture) << capture.error().text();
    auto& packets = capture->datagrams;
    std::erase_if(packets, [](const UdpDatagram& d) { return d.payload.size() != 1206; });
    ASSERT_EQ(sweeps.size(), 20U);
    constexpr std::int64_t kPacket_ns = 1'327'104, kSweep_ns = 100'000'000;
    std::size_t packet = 0;
    for (const auto& row : sweeps) {
        const std::int64_t sweep = whole(row, "sweep"), first_ns = whole(row, "t_first_shot_ns");
        EXPECT_EQ(sweep, first_ns / kSweep_ns);
        EXPECT_EQ(first_ns, static_cast<std::int64_t>(packet) * kPacket_ns);
        uLong crc = 0;
        for (std::int64_t i = 0; i < whole(row, "packets"); ++i, ++packet) {
            ASSERT_LT(packet, packets.size());
            crc = ::crc32(crc, packets[packet].payload.data(), 1206);
        }
        EXPECT_EQ(whole(row, "packets_crc32"), static_cast<std::int64_t>(crc)) << sweep;
        EXPECT_EQ(whole(row, "shots"), 384 * whole(row, "packets"));
        const auto end_ns = static_cast<std::int64_t>(packet) * kPacket_ns;
        EXPECT_EQ(whole(row, "t_complete_ns"), end_ns);
        EXPECT_EQ(whole(row, "t_hand_over_ns"), end_ns) << "in lockstep a packet is sent when it is complete";
        // The last laser of the second firing sequence of a packet's last block: 11 blocks, 55,296 and 15 * 2,304
        // ns.
        EXPECT_EQ(whole(row, "t_last_shot_ns"), end_ns - kPacket_ns + 11 * 110'592 + 55'296 + 15 * 2'304);
        EXPECT_EQ(whole(row, "packets_late") + whole(row, "packets_skipped") + whole(row, "packets_lost"), 0);
    }
    EXPECT_EQ(packet, packets_);
    EXPECT_EQ(packet, packets.size());
}

TEST_F(SweepLogs, AreTheSameOnAnyNumberOfThreads) {
    run("one", 1, true);
    run("many", 5, true);
    for (const char* file : {"/top.sweeps.csv", "/top.shots.csv"}) {
        EXPECT_GT(read_text((folder_ / "one") + file).size(), 1000U);
        EXPECT_EQ(read_text((folder_ / "one") + file), read_text((folder_ / "many") + file)) << file;
    }
}

TEST_F(SweepLogs, HaveTheTruthOfEveryShotBesideWhatIsReportedOfIt) {
    run("noisy", 2, true, "range_noise_m = 0.02");
    const Rows sweeps = read_rows(folder_ / "noisy/top.sweeps.csv"),
               shots = read_rows(folder_ / "noisy/top.shots.csv");
    ASSERT_EQ(shots.size(), 384 * packets_);
    std::int64_t returns = 0, reported = 0;
    for (const auto& row : sweeps) returns += whole(row, "returns");
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < shots.size(); ++i) {
        const auto& row = shots[i];
        EXPECT_EQ(whole(row, "packet"), static_cast<std::int64_t>(i) / 384);
        const double exact = std::stod(row.at("range_m")), measured = std::stod(row.at("reported_range_m"));
        EXPECT_EQ(exact > 0, measured > 0);
        EXPECT_EQ(whole(row, "body") >= 0, exact > 0);
        if (!(exact > 0)) continue;
        ++reported;
        sum += measured - exact, squares += (measured - exact) * (measured - exact);
    }
    EXPECT_EQ(reported, returns);
    ASSERT_GT(reported, 4000);
    const auto n = static_cast<double>(reported);
    EXPECT_NEAR(sum / n, 0, 4 * 0.02 / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(squares / n), 0.02, 4 * 0.02 / std::sqrt(2 * n));
}

}  // namespace
}  // namespace narpa::test
