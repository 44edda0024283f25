// Budgets of rays and of time, from the scene file to what is handed over and what is told of it.
#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <numeric>
#include <thread>

#include "emulator/report.h"
#include "protocols/video/embedded_line.h"
#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

constexpr int kWidth = 160, kHeight = 48;  // wide enough for the embedded line
constexpr std::uint64_t kPixels = kWidth * kHeight;

using Row = std::map<std::string, std::string>;

std::uint64_t whole(const Row& row, const char* name) {
    return std::stoull(row.at(name));
}
std::vector<std::uint64_t> passes_of(const Row& row) {
    std::vector<std::uint64_t> passes;
    std::istringstream text(row.at("passes"));
    for (std::string part; std::getline(text, part, ';');) passes.push_back(std::stoull(part));
    return passes;
}

/// What holds for every frame, whatever limited it.
void expect_complete(const Row& row) {
    const auto time = [&](const char* name) { return std::stoll(row.at(name)); };
    EXPECT_LE(time("t_exposure_start_ns"), time("t_exposure_mid_ns"));
    EXPECT_LE(time("t_exposure_mid_ns"), time("t_exposure_end_ns"));
    EXPECT_LE(time("t_exposure_end_ns"), time("t_render_start_ns"));
    EXPECT_LE(time("t_render_start_ns"), time("t_render_end_ns"));
    EXPECT_LE(time("t_render_end_ns"), time("t_hand_over_ns"));
    EXPECT_EQ(row.at("deadline_met"), time("t_hand_over_ns") <= time("t_deadline_ns") ? "1" : "0");
    EXPECT_NE(kStepNames[whole(row, "step")], "nothing");  // a whole frame
    const std::vector<std::uint64_t> passes = passes_of(row);
    const std::uint64_t refining = std::accumulate(passes.begin(), passes.end(), std::uint64_t{0});
    const bool refined = whole(row, "step") == 0, by_samples = row.at("budget_kind") == "samples";
    EXPECT_EQ(passes.empty(), !refined || by_samples);
    if (!by_samples) {
        EXPECT_LE(whole(row, "samples"), kPixels + refining);  // the middles, and theirs
    }
    EXPECT_GE(whole(row, "samples"), refining);
    EXPECT_GE(whole(row, "rays"), whole(row, "samples"));
    EXPECT_NEAR(std::stod(row.at("samples_per_pixel")), static_cast<double>(whole(row, "samples")) / kPixels, 1e-3);
    if (refined) {
        EXPECT_GE(std::stod(row.at("expected_error")), 0);
    }
}

class Budgets : public LoopTest {
protected:
    static std::string scene_with(const std::string& render_keys, const std::string& camera_keys = "") {
        return with_resolution(
            with_render(small_scene("rate_hz = 10\nembedded_line = true\n" + camera_keys), render_keys),
            "[160, 48]");
    }
    std::unique_ptr<Emulator> run(const std::string& text, const RunOptions& o) { return ran(scene(text), o); }
    RunOptions lockstep(const std::string& bus, int threads) {
        RunOptions o;
        o.bus = bus;
        o.lockstep = true;
        o.threads = threads;
        o.video = {{"nav", folder_ / "nav.y4m"}};
        o.log_folder = folder_ / "log";
        return o;
    }
};

/// Something else to do for the processors, now and then.
class Load {
public:
    explicit Load(bool on) {
        if (on)
            thread_ = std::thread([this] {
                while (!done_) ++work_;
            });
    }
    ~Load() {
        done_ = true;
        if (thread_.joinable()) thread_.join();
    }

private:
    std::atomic<bool> done_{false};
    std::atomic<std::uint64_t> work_{0};
    std::thread thread_;
};

class SameBytes : public Budgets, public ::testing::WithParamInterface<const char*> {};

TEST_P(SameBytes, InTwentyRunsOnOneToFourThreadsUnderLoadOrNot) {
    const std::string bus = record(5);
    const std::string text = scene_with(GetParam(), "detector = {exposure_s = 0.002, shot_noise = true}");
    std::string video, ledger;
    for (int i = 0; i < 20; ++i) {
        const Load load(i % 3 == 2);
        ASSERT_TRUE(run(text, lockstep(bus, 1 + i % 4)));
        const std::string again = read_text(folder_ / "nav.y4m");
        if (i == 0) video = again, ledger = read_text(folder_ / "log/nav.ledger.csv");
        ASSERT_GT(again.size(), 5 * kPixels);
        ASSERT_TRUE(again == video) << "run " << i;
        ASSERT_EQ(read_text(folder_ / "log/nav.ledger.csv"), ledger) << "run " << i;
    }
}

INSTANTIATE_TEST_SUITE_P(Of, SameBytes,
                         ::testing::Values("spp = 3", "budget_rays = 40000",
                                           "method = \"path\"\nbudget_rays = 60000"));

/// Commands the chaser on the emulator's bus and keeps the ledgers of so many frames.
std::vector<FrameLedger> fly(CanBus& hub, const std::vector<PoseCommand>& commands, std::size_t frames) {
    const auto bus = open_or_fail("slcan:" + std::to_string(hub_port(hub)), CanRole::client);
    if (!bus) return {};
    for (const PoseCommand& command : commands) {
        FrameSet encoded;
        EXPECT_TRUE(encode_classic(command, 0x100, encoded));
        for (const CanFrame& frame : encoded) EXPECT_TRUE(bus->send(frame));
    }
    LedgerDecoder decoder;
    std::vector<FrameLedger> ledgers;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(1800);
    while (ledgers.size() < frames && std::chrono::steady_clock::now() < until) {
        bus->wait(10'000'000);
        FrameLedger ledger;
        for (ReceivedFrame got; bus->receive(got);)
            if (decoder.accept(got.frame, 0, ledger) == DecodeStatus::complete) ledgers.push_back(ledger);
    }
    return ledgers;
}

TEST_F(Budgets, OfRaysAreKeptAndReportedAlikeInLogOnBusAndInImage) {
    RunOptions o = lockstep("slcan:0", 2);
    o.duration_s = 0.8;
    auto emulator = Emulator::create(scene(scene_with("budget_rays = 40000")), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    StopFlag stop{false};
    std::thread loop([&] { EXPECT_TRUE((*emulator)->run(stop)); });
    std::vector<PoseCommand> commands;
    for (int k = 0; k <= 8; ++k) commands.push_back(command(k));
    const std::vector<FrameLedger> on_bus = fly((*emulator)->can()->bus(), commands, 8);
    stop = true;
    loop.join();

    const std::vector<Row> rows = read_rows(folder_ / "log/nav.ledger.csv");
    const std::string video = read_text(folder_ / "nav.y4m");
    ASSERT_EQ(rows.size(), 8U);
    ASSERT_EQ(on_bus.size(), 8U);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const Row& row = rows[i];
        expect_complete(row);
        EXPECT_EQ(row.at("budget_kind"), "rays");
        EXPECT_EQ(row.at("budget"), "40000");
        EXPECT_EQ(row.at("delivery"), "frame");
        EXPECT_LE(whole(row, "rays"), 40'000U);
        EXPECT_GT(whole(row, "rays"), 20'000U);  // and made use of

        const std::size_t end = video.size() - (rows.size() - 1 - i) * (kPixels + 6);
        const std::string_view last(video.data() + end - kWidth, kWidth);
        const auto line = decode_embedded_line({reinterpret_cast<const std::uint8_t*>(last.data()), last.size()});
        ASSERT_TRUE(line);
        const std::vector<std::uint64_t> passes = passes_of(row);
        for (std::size_t p = 0; p < FrameLedger::kPasses; ++p)
            EXPECT_EQ(line->passes[p], p < passes.size() ? passes[p] : 0U);
        for (const FrameLedger* l : {&*line, &on_bus[i]}) {
            EXPECT_EQ(l->frame, whole(row, "frame"));
            EXPECT_EQ(l->step, whole(row, "step"));
            EXPECT_EQ(l->samples, whole(row, "samples"));
            EXPECT_EQ(l->rays, whole(row, "rays"));
            EXPECT_EQ(l->budget_kind, BudgetKind::rays);
            EXPECT_EQ(l->budget, 40'000U);
            EXPECT_EQ(l->delivery, Delivery::frame);
            EXPECT_TRUE(l->deadline_met);
            EXPECT_NEAR(l->samples_per_pixel, std::stod(row.at("samples_per_pixel")), 1.0 / 256);
            EXPECT_NEAR(l->expected_error, std::stod(row.at("expected_error")), 2e-7);
        }
    }
}

TEST_F(Budgets, TheReportCountsFramesByStep) {
    // The first is too little for anything but a coarse frame.
    for (const auto& [rays, step] : {std::pair{"700", "coarse_4"}, std::pair{"40000", "refined"}}) {
        const auto emulator = run(scene_with(std::string("budget_rays = ") + rays), lockstep(record(4), 2));
        ASSERT_TRUE(emulator);
        const nlohmann::json told = report(*emulator);
        const nlohmann::json& camera = told["cameras"][0];
        for (const std::string_view name : kStepNames)
            EXPECT_EQ(camera["steps"][std::string(name)], name == step ? 4 : 0) << name;
        EXPECT_NE(to_text(*emulator).find(std::string("steps: 4 ") + step), std::string::npos)
            << to_text(*emulator);
        for (const Row& row : read_rows(folder_ / "log/nav.ledger.csv"))
            EXPECT_EQ(kStepNames[whole(row, "step")], step);
    }
}

TEST(Report, CountsFramesByLateness) {
    SignedHistogram late;
    for (int i = 0; i < 7; ++i) late.add(-2'000'000);
    for (int i = 0; i < 2; ++i) late.add(500'000);
    late.add(-45'000'000);
    const nlohmann::json told = lateness(late);
    EXPECT_EQ(lateness_text(late), "1 over 30 ms early, 7 1 to 3 ms early, 2 0.3 to 1 ms late");
    std::uint64_t frames = 0;
    for (const nlohmann::json& bin : told["bins"]) frames += bin["frames"].get<std::uint64_t>();
    EXPECT_EQ(frames, late.count());
    EXPECT_NEAR(told["p50"].get<double>(), -2, 0.07);
    EXPECT_EQ(told["max"], 0.5);
    EXPECT_EQ(lateness_text({}), "none");
    EXPECT_EQ(against_deadline(-1.69), "1.69 ms before");
    EXPECT_EQ(against_deadline(0.3), "0.30 ms after");
}

/// Samples that take half a second of one thread at least, where a frame is due each tenth of a second.
TEST_F(Budgets, InRealTimeTheDeadlineBoundsTheSamplesUnlessTheSceneKeepsThem) {
    for (const bool keeps : {true, false}) {
        RunOptions o;
        o.duration_s = 0.5;
        o.threads = 1;
        o.video = {{"nav", folder_ / "nav.y4m"}};
        o.log_folder = folder_ / "log";
        const std::string keys = keeps ? "spp = 1500" : "spp = 1500\nkeep_deadline = false";
        ASSERT_TRUE(run(scene_with(keys), o));
        const std::vector<Row> rows = read_rows(folder_ / "log/nav.ledger.csv");
        ASSERT_FALSE(rows.empty());
        for (const Row& row : rows) {
            EXPECT_EQ(row.at("budget_kind"), keeps ? "time" : "samples");
            EXPECT_EQ(row.at("budget"), keeps ? "100000000" : "1500");
        }
    }
}

/// In real time: how far each frame gets is up to the machine, what is said of it must fit together.
class BudgetOfTime : public Budgets, public ::testing::WithParamInterface<const char*> {};

TEST_P(BudgetOfTime, IsADeadlineThatEachWholeFrameMeetsOrIsCountedToMiss) {
    RunOptions o;
    o.duration_s = 1;
    o.video = {{"nav", folder_ / "nav.y4m"}};
    o.log_folder = folder_ / "log";
    const std::string method = std::string("method = \"") + GetParam() + "\"\nbudget_ms = 30";
    const auto emulator = run(scene_with(method, "late_policy = \"drop\"\ndetector = {exposure_s = 0.01}"), o);
    ASSERT_TRUE(emulator);
    const CameraStats& c = camera_of(*emulator).stats();
    EXPECT_EQ(c.frames + c.skipped, 10U);
    EXPECT_EQ(c.late.count(), c.frames);
    EXPECT_EQ(c.steps[static_cast<std::size_t>(FrameStep::nothing)], 0U);
    EXPECT_EQ(std::accumulate(c.steps.begin(), c.steps.end(), std::uint64_t{0}), c.frames);
    const std::vector<Row> rows = read_rows(folder_ / "log/nav.ledger.csv");
    ASSERT_EQ(rows.size(), c.frames);
    std::uint64_t missed = 0, handed_over = 0;
    for (const Row& row : rows) {
        EXPECT_EQ(row.at("budget_kind"), "time");
        EXPECT_EQ(row.at("budget"), "30000000");
        EXPECT_EQ(std::stoll(row.at("t_deadline_ns")), std::stoll(row.at("t_exposure_end_ns")) + 30'000'000);
        const bool out = row.at("delivery") == "frame";
        handed_over += out;
        missed += row.at("deadline_met") == "0";
        if (out) {
            expect_complete(row);
        } else {
            EXPECT_EQ(row.at("delivery") + row.at("deadline_met") + row.at("t_hand_over_ns"), "nothing00");
        }
    }
    EXPECT_EQ(c.deadline_missed, missed);
    EXPECT_EQ(c.handed_over, handed_over);
    const std::string video = read_text(folder_ / "nav.y4m");
    EXPECT_EQ(video.size() - video.find('\n') - 1, handed_over * (kPixels + 6));
}

INSTANTIATE_TEST_SUITE_P(By, BudgetOfTime, ::testing::Values("direct", "path"));

}  // namespace
}  // namespace narpa::test
