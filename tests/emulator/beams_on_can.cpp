// A velocimeter's shots on the CAN bus of a run: each once, at its own time, as measured.
#include <cmath>

#include "protocols/can/candump.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

class BeamsOnCan : public LoopTest {
protected:
    std::string scene_text() {
        std::ofstream(folder_ / "velocimeter.toml")
            << "[lidar]\nname = \"velocimeter\"\nrate_hz = 20\nrange_max_m = 100\nrange_resolution_m = 0.01\n"
               "velocity_resolution_m_s = 0.001\n[[beam]]\nazimuth_deg = 0\nelevation_deg = 0\n"
               "[[beam]]\nazimuth_deg = 45\nelevation_deg = 0\nphase = 0.25\n";
        std::string text = small_scene();
        const std::string vlp16 = "model = \"VLP-16\"\nrate_hz = 10";
        return text.replace(text.find(vlp16), vlp16.size(), "model = \"velocimeter.toml\"");
    }
    Result<std::unique_ptr<Emulator>> create(const std::string& text, const std::string& sink, bool bus = true) {
        RunOptions o;
        if (bus) o.bus = record(21);
        o.lockstep = bus;
        o.log_folder = folder_ / "log";
        o.lidar = {{"top", sink}};
        return Emulator::create(scene(text), o);
    }
};

TEST_F(BeamsOnCan, AreEveryShotOnceAsMeasured) {
    auto emulator = create(scene_text(), "can");
    ASSERT_TRUE(emulator) << emulator.error().text();
    EXPECT_EQ(lidar_of(**emulator).outputs(), std::vector<std::string>{"CAN"});
    ASSERT_TRUE((*emulator)->run(StopFlag{false}));
    MessageDecoder<LidarBeamReport> decoder;
    std::vector<LidarBeamReport> reports;
    std::ifstream log(folder_ / "log/can.log");
    LidarBeamReport report;
    CandumpLine line;
    for (std::string text; std::getline(log, text);)
        if (parse_candump(text, line) == nullptr &&
            decoder.accept(line.frame, 1'000'000'000, report) == DecodeStatus::complete)
            reports.push_back(report);
    ASSERT_EQ(reports.size(), 80U);  // two seconds of 20 Hz and two beams
    for (std::size_t i = 0; i < reports.size(); ++i) {
        const LidarBeamReport& r = reports[i];
        EXPECT_EQ(r.counter, i % 256);
        EXPECT_EQ(r.beam, i % 2);
        EXPECT_EQ(r.t_ns, static_cast<std::int64_t>(i / 2) * 50'000'000 + (i % 2 == 0 ? 0 : 12'500'000));
        EXPECT_EQ(std::isnan(r.range_m), i % 2 == 1) << "the second beam passes the target";
        EXPECT_EQ(std::isnan(r.velocity_m_s), i % 2 == 1);
        if (i % 2 == 1) continue;
        // The beam turns with the chaser: near the middle of the sphere of 2 m, ahead at 0.5 m/s.
        EXPECT_NEAR(r.range_m, 10 - 0.1 - 2 - 0.5e-9 * static_cast<double>(r.t_ns), 0.1);
        EXPECT_NEAR(r.velocity_m_s, -0.5, 0.05);
        EXPECT_NEAR(100 * r.range_m, std::round(100 * r.range_m), 1e-3) << "in the instrument's steps";
    }
}

TEST_F(BeamsOnCan, NeedABusAndAnInstrumentThatIsSlowEnough) {
    const auto no_bus = create(scene_text(), "can", false);
    ASSERT_FALSE(no_bus);
    EXPECT_NE(no_bus.error().text().find("--lidar top=can needs --can BUS"), std::string::npos);
    const auto fast = create(small_scene(), "can");
    ASSERT_FALSE(fast);
    EXPECT_NE(fast.error().text().find("289352 shots a second, expected at most 1000"), std::string::npos)
        << fast.error().text();
}

}  // namespace
}  // namespace narpa::test
