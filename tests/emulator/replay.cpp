// A logged run made again: bit for bit from its log, what is wrong with the log, and what the budget cost.
#include "emulator/replay/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "emulator/replay/replay_report.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"

namespace narpa::test {
namespace {

using nlohmann::json;
using namespace nlohmann::literals;

/// What the sensor adds to the light repeats as well, and the ledger in the image.
const char* const kDetector =
    "rate_hz = 10\nformat = \"Y16\"\nembedded_line = true\n"
    "detector = {exposure_s = 0.002, f_number = 8.0, pixel_pitch_m = 5.5e-6, quantum_efficiency = 0.6, "
    "full_well_e = 13500, shot_noise = true, read_noise_e = 5.0, bits = 12}";

class ReplayTest : public LoopTest {
protected:
    static std::string scene_with(const std::string& budget, const std::string& camera = "rate_hz = 10",
                                  const char* resolution = "[80, 48]") {
        std::string text = small_scene(camera);
        text.replace(text.find("[64, 48]"), 8, resolution);
        text.replace(text.find("spp = 2"), 7, budget);
        return text;
    }

    /// Runs the scene over `commands` recorded commands, in real time or in lockstep; returns its log folder.
    std::string run(const std::string& text, int commands = 5, bool lockstep = true) {
        const std::string log = folder_ / "log";
        RunOptions o;
        o.bus = record(commands);
        o.lockstep = lockstep;
        o.duration_s = lockstep ? 0 : 0.1 * commands;
        o.log_folder = log;
        o.video = {{"nav", "none"}};
        ran(scene(text), o);
        return log;
    }

    static std::unique_ptr<Replay> open(const std::string& log) {
        auto replay = Replay::open(log, "", "");
        if (!replay) {
            ADD_FAILURE() << replay.error().text();
            return nullptr;
        }
        return *std::move(replay);
    }

    /// Makes every frame of the log again; returns how many were made.
    static std::size_t expect_repeats(const std::string& log) {
        const auto replay = open(log);
        if (!replay) return 0;
        std::size_t made = 0;
        for (std::size_t i = 0; i < replay->frames().size(); ++i) {
            if (!replay->has_image(i)) continue;
            const auto differs = replay->make(i);
            EXPECT_TRUE(differs.empty()) << "frame " << i << ": " << differs.front();
            ++made;
        }
        return made;
    }

    /// Writes the file anew with the first `from` replaced.
    static void tamper(const std::string& file, const std::string& from, const std::string& to) {
        std::string text = read_text(file);
        ASSERT_NE(text.find(from), std::string::npos) << file;
        text.replace(text.find(from), from.size(), to);
        std::ofstream(file) << text;
    }
    /// Gives a row of the ledger another value.
    static void set_cell(const std::string& log, std::size_t row, std::string_view column,
                         const std::string& value) {
        std::string text = read_text(log + "/nav.ledger.csv");
        std::size_t index = 0;
        for (std::size_t at = 0; ledger_header().substr(at, column.size()) != column; ++index)
            at = ledger_header().find(',', at) + 1;
        std::size_t at = 0;
        for (std::size_t i = 0; i < row; ++i) at = text.find('\n', at) + 1;
        for (std::size_t i = 0; i < index; ++i) at = text.find(',', at) + 1;
        text.replace(at, text.find_first_of(",\n", at) - at, value);
        std::ofstream(log + "/nav.ledger.csv") << text;
    }

    static void expect_refused(const std::string& log, const std::string& words) {
        const auto replay = Replay::open(log, "", "");
        ASSERT_FALSE(replay) << words;
        EXPECT_NE(replay.error().text().find(words), std::string::npos) << replay.error().text();
    }
};

TEST_F(ReplayTest, ARunWithABudgetInRaysRepeatsBitForBit) {
    const std::string log = run(scene_with("budget_rays = 20000", kDetector));
    EXPECT_EQ(expect_repeats(log), 5U);
    const auto frames = read_ledger_log(log + "/nav.ledger.csv");
    ASSERT_TRUE(frames);
    EXPECT_GT((*frames)[2].ledger.passes[0], 0U);  // it had samples of its own to repeat
}

TEST_F(ReplayTest, SamplesOfSunlightAloneRepeatBitForBit) {
    const std::string log = run(scene_with("method = \"path\"\nbudget_rays = 100000", kDetector), 2);
    EXPECT_EQ(expect_repeats(log), 2U);
    const auto frames = read_ledger_log(log + "/nav.ledger.csv");
    ASSERT_TRUE(frames);
    EXPECT_GT((*frames)[1].ledger.passes[kSunlightPass], 0U);
}

TEST_F(ReplayTest, ARunWithFixedSamplesRepeatsBitForBit) {
    EXPECT_EQ(expect_repeats(run(scene_with("spp = 3", kDetector))), 5U);
}

/// The log has the poses at the exposure's start and end.
TEST_F(ReplayTest, ARollingShutterRepeatsBitForBit) {
    const std::string camera = std::string(kDetector) + "\nshutter = {kind = \"rolling\", row_time_s = 0.001}";
    for (const char* budget : {"spp = 3", "budget_rays = 20000"})
        EXPECT_GE(expect_repeats(run(scene_with(budget, camera))), 4U) << budget;
}

/// They turn with the clock and move with the velocity of the body that carries the camera.
TEST_F(ReplayTest, StarsRepeatBitForBit) {
    std::string catalogue = "name,ra_deg,dec_deg,v_mag,b_v,pm_ra_mas_yr,pm_dec_mas_yr\n";
    for (int ra = 0; ra < 360; ra += 10)  // bright enough for this detector
        for (int dec = -80; dec <= 80; dec += 10) catalogue += fmt::format("s,{},{},-12,,,\n", ra, dec);
    std::ofstream(folder_ / "stars.csv") << catalogue;
    const std::string stars = "[stars]\ncatalogue = \"stars.csv\"\nrate_rad_s = [1, 2, 3]\n\n";
    for (const char* shutter : {"", "\nshutter = {kind = \"rolling\", row_time_s = 0.001}"})
        EXPECT_GE(expect_repeats(run(stars + scene_with("spp = 1", std::string(kDetector) + shutter))), 4U)
            << shutter;
}

/// Without indirect light and with it: what paths share depends on which are traced
/// together.
TEST_F(ReplayTest, ByPathsToo) {
    std::size_t steps = 0;
    for (const char* budget : {"budget_rays = 5000", "budget_rays = 13000", "budget_rays = 80000"}) {
        const std::string log = run(scene_with(std::string("method = \"path\"\n") + budget), 2);
        EXPECT_EQ(expect_repeats(log), 2U) << budget;
        const auto frames = read_ledger_log(log + "/nav.ledger.csv");
        ASSERT_TRUE(frames);
        steps |= std::size_t{1} << frames->front().ledger.step;
    }
    EXPECT_GE(std::popcount(steps), 2) << steps;
}

TEST_F(ReplayTest, FramesOfEveryStepRepeat) {
    std::size_t steps = 0;
    for (const char* budget : {"budget_rays = 290", "budget_rays = 5000", "budget_rays = 40000"}) {
        const std::string log = run(scene_with(budget, kDetector), 2);
        EXPECT_EQ(expect_repeats(log), 2U) << budget;
        const auto frames = read_ledger_log(log + "/nav.ledger.csv");
        ASSERT_TRUE(frames);
        steps |= std::size_t{1} << frames->front().ledger.step;
    }
    EXPECT_EQ(std::popcount(steps), 3) << steps;
}

/// The clock chose the passes; the log has them. Commands arrive while frames are made.
TEST_F(ReplayTest, ARunAgainstTheClockRepeatsBitForBit) {
    const std::string log = run(scene_with("budget_ms = 20", kDetector, "[160, 120]"), 5, false);
    EXPECT_GE(expect_repeats(log), 1U);
    const auto frames = read_ledger_log(log + "/nav.ledger.csv");
    ASSERT_TRUE(frames);
    EXPECT_EQ(frames->front().ledger.budget_kind, BudgetKind::time);
    EXPECT_EQ(frames->front().ledger.budget, 20'000'000U);
}

TEST_F(ReplayTest, TheLogsChecksumIsOfTheBytesAsHandedOver) {
    const std::string bus = record(2);
    RunOptions o;
    o.bus = bus;
    o.lockstep = true;
    o.log_folder = folder_ / "log";
    o.video = {{"nav", folder_ / "a.y4m"}};
    ASSERT_TRUE(ran(scene(scene_with("spp = 1", kDetector)), o));
    const std::string video = read_text(folder_ / "a.y4m");
    const auto frames = read_ledger_log(o.log_folder + "/nav.ledger.csv");
    ASSERT_TRUE(frames);
    ASSERT_EQ(frames->size(), 2U);
    const std::size_t bytes = 80 * 48 * 2, last = video.size() - bytes;
    const auto* const at = reinterpret_cast<const std::uint8_t*>(video.data());
    EXPECT_EQ(image_crc32({at + last, bytes}), frames->back().image_crc32);
    EXPECT_EQ(image_crc32({at + last - 6 - bytes, bytes}), frames->front().image_crc32);
}

TEST_F(ReplayTest, TheChecksumIsTheUsualOne) {
    // The check value of CRC-32 of IEEE 802.3: Ross Williams, "A painless guide to CRC error detection algorithms".
    const std::string digits = "123456789";
    EXPECT_EQ(image_crc32({reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size()}), 0xCBF43926U);
}

TEST_F(ReplayTest, ARowOfTheLedgerReadsBackBitForBit) {
    FrameLedger l;
    l.frame = 7;
    l.pose_counter = 255;
    l.pose_stale = true;
    l.deadline_met = false;
    l.delivery = Delivery::repeated;
    l.step = 3;
    l.budget_kind = BudgetKind::time;
    l.budget = 60'000'000;
    l.samples = 400;
    l.rays = 1'000'000'000'007;
    l.samples_per_pixel = 0.1F;
    l.expected_error = 1.0F / 3;
    l.t_pose_ns = -5;
    l.t_hand_over_ns = 700'000'000'123;
    std::array<char, 512> row;
    for (const FrameLedger::Passes& passes :
         {FrameLedger::Passes{}, FrameLedger::Passes{300, 99}, FrameLedger::Passes{300, 0, 0, 0, 0, 0, 0, 99}}) {
        l.passes = passes;
        const std::size_t size = format_ledger_row(row, l, 0x00C0FFEE);
        ASSERT_GT(size, 0U);
        std::ofstream(folder_ / "l.csv") << ledger_header() << "\n" << std::string_view(row.data(), size);
        const auto frames = read_ledger_log(folder_ / "l.csv");
        ASSERT_TRUE(frames) << frames.error().text();
        ASSERT_EQ(frames->size(), 1U);
        EXPECT_TRUE(frames->front().ledger == l);
        EXPECT_EQ(frames->front().image_crc32, 0x00C0FFEEU);
    }
    EXPECT_EQ(format_ledger_row(std::span(row).first(20), l, 0), 0U);
}

TEST_F(ReplayTest, FindsARowThatIsNotAsTheFrameWas) {
    const std::string log = run(scene_with("budget_rays = 20000"));
    const auto frames = read_ledger_log(log + "/nav.ledger.csv");
    ASSERT_TRUE(frames);
    const FrameLedger& second = (*frames)[1].ledger;
    const struct {
        std::string_view column;
        std::string value, words;
    } forgeries[] = {
        {"image_crc32", "00000000", "image_crc32: "},
        {"passes", std::to_string(second.passes[0] - 200), "samples: "},
        {"rays", std::to_string(second.rays + 1), fmt::format("rays: {}, logged {}", second.rays, second.rays + 1)},
        {"step", "1", "samples: "},
        {"expected_error", "0.5", "expected_error: "},
        {"expected_error", "nan", "expected_error: "},
        {"expected_error", "-1", "expected_error: "},
        {"t_exposure_mid_ns", "200000000", "image_crc32: "},
        {"frame", "9", "image_crc32: "},
    };
    const std::string good = read_text(log + "/nav.ledger.csv");
    for (const auto& forgery : forgeries) {
        SCOPED_TRACE(forgery.column);
        std::ofstream(log + "/nav.ledger.csv") << good;
        set_cell(log, 2, forgery.column, forgery.value);
        const auto replay = open(log);
        ASSERT_TRUE(replay);
        EXPECT_TRUE(replay->make(0).empty());
        const auto differs = replay->make(1);
        EXPECT_TRUE(std::any_of(differs.begin(), differs.end(), [&](const std::string& text) {
            return text.starts_with(forgery.words);
        })) << fmt::format("{}", fmt::join(differs, "; "));
    }
}

TEST_F(ReplayTest, FindsPosesThatAreNotAsTheyWere) {
    const std::string log = run(scene_with("spp = 2"), 2);
    tamper(log + "/nav.truth.csv", "0.100000000,chaser,-9.95,", "0.100000000,chaser,-9.94,");
    const auto replay = open(log);
    ASSERT_TRUE(replay);
    EXPECT_TRUE(replay->make(0).empty());
    EXPECT_FALSE(replay->make(1).empty());
}

TEST_F(ReplayTest, NamesTheFilesThatHaveChangedSinceTheRun) {
    const std::string log = run(scene_with("spp = 2"), 2);
    EXPECT_EQ(open(log)->changed_files(), std::vector<std::string>());
    EXPECT_NE(read_text(log + "/scene.toml").find("[[camera]]"), std::string::npos);
    const std::string scene = json::parse(read_text(log + "/run.json"))["scene"];
    std::ofstream(scene, std::ios::app) << "# no change in meaning\n";
    EXPECT_EQ(open(log)->changed_files(), std::vector<std::string>{scene});
}

TEST_F(ReplayTest, ErrorsOfALogNamePlaceAndCause) {
    expect_refused(folder_ / "nowhere", "run.json: is not there, expected the log folder of a run");
    const std::string log = run(scene_with("budget_rays = 20000"), 3);
    const std::string ledger = log + "/nav.ledger.csv", truth = log + "/nav.truth.csv",
                      record_file = log + "/run.json";
    const std::string good_ledger = read_text(ledger), good_truth = read_text(truth),
                      good_record = read_text(record_file);

    const auto bad_cell = [&](std::string_view column, const std::string& value, const std::string& words) {
        std::ofstream(ledger) << good_ledger;
        set_cell(log, 2, column, value);
        expect_refused(log, words);
    };
    bad_cell("frame", "1x", "nav.ledger.csv:3:1: frame: \"1x\", expected a whole number");
    bad_cell("step", "7", "step: \"7\", expected a step, 0 to 6");
    bad_cell("passes", "5;;7", "passes: \"5;;7\", expected at most 8 numbers of samples");
    bad_cell("passes", "5;0", "passes: \"5;0\", expected at most 8 numbers of samples");
    bad_cell("passes", "4000000000", "together at most as many as the frame's");
    bad_cell("budget_kind", "money", "budget_kind: \"money\", expected samples, rays or time");
    bad_cell("deadline_met", "yes", "deadline_met: \"yes\", expected 0 or 1");
    bad_cell("image_crc32", "12345", "image_crc32: \"12345\", expected 8 hexadecimal digits");
    bad_cell("binning", "0", "binning: \"0\", expected a whole number from 1 to 255");
    bad_cell("trigger", "often", "trigger: \"often\", expected free_running, command, sync or external");
    bad_cell("region_x", "70000", "region_x: \"70000\", expected a whole number");
    bad_cell("t_exposure_mid_ns", "100000001", "nav.ledger.csv:3:1: frame 1 at 100000001 ns: ");
    std::ofstream(ledger) << good_ledger << "3,0\n";
    expect_refused(log, "nav.ledger.csv:5:1: 2 columns, expected 34");
    std::ofstream(ledger) << "hello\n";
    expect_refused(log, "nav.ledger.csv:1:1: expected the header line");
    std::filesystem::remove(ledger);
    expect_refused(log, "nav.ledger.csv: cannot be read");
    std::ofstream(ledger) << good_ledger;

    tamper(truth, "target", "nobody");
    expect_refused(log, "nav.truth.csv:2: body \"nobody\" at 0.000000000 s, which the scene");
    std::ofstream(truth) << good_truth.substr(0, good_truth.size() / 2);
    expect_refused(log, "nav.truth.csv:");
    std::ofstream(truth) << good_truth;

    std::ofstream(record_file) << "{\n\"format\": 1,\n oops";
    expect_refused(log, "run.json:3:2: not JSON");
    std::ofstream(record_file) << good_record;
    tamper(record_file, "\"seed\": 42", "\"seed\": -1");
    expect_refused(log, "seed: expected a whole number from 0");
    std::ofstream(record_file) << good_record;
    tamper(record_file, "\"direct\"", "\"magic\"");
    const auto lines_before =
        std::count(good_record.begin(),
                   good_record.begin() + static_cast<std::ptrdiff_t>(good_record.find("\"method\"")), '\n');
    expect_refused(log, fmt::format("run.json:{}:5: method: expected direct or path", lines_before + 1));
    std::ofstream(record_file) << good_record;
    tamper(record_file, "\"size_b\": ", "\"size\": ");
    expect_refused(log, "files: expected an array of {file, size_b, fnv1a}");
    std::ofstream(record_file) << good_record;
    std::filesystem::remove(folder_ / "scene.toml");
    expect_refused(log, "scene.toml");
}

// --- What the budget cost ---------------------------------------------------

/// A camera that the target fits into.
const char* const kWhole[]{"rate_hz = 10", "[96, 80]"};

/// Over the frames of a run of this budget.
BudgetCost cost_of(Replay& replay, int reference_spp) {
    std::vector<ReplayedFrame> frames;
    for (std::size_t i = 0; i < replay.frames().size(); ++i) {
        auto differs = replay.make(i);
        frames.push_back({replay.frames()[i], std::move(differs), replay.against(reference_spp)});
    }
    return budget_cost(frames);
}

TEST_F(ReplayTest, MoreBudgetCostsLessError) {
    std::vector<BudgetCost> costs;
    for (const char* budget : {"spp = 1", "budget_rays = 30000", "budget_rays = 200000"}) {
        const auto replay = open(run(scene_with(budget, kWhole[0], kWhole[1]), 3));
        ASSERT_TRUE(replay);
        costs.push_back(cost_of(*replay, 128));
    }
    for (std::size_t i = 0; i + 1 < costs.size(); ++i) {
        EXPECT_GT(costs[i].rmse, 1.5 * costs[i + 1].rmse) << i;
        EXPECT_LT(costs[i].ssim_mean, costs[i + 1].ssim_mean) << i;
        EXPECT_GT(costs[i].edges.rms_px, costs[i + 1].edges.rms_px) << i;
    }
    for (const BudgetCost& c : costs) {
        EXPECT_EQ(c.frames, 3U);
        EXPECT_EQ(c.bodies, 3U);  // the target; the chaser, whose camera it is, is not in view
        EXPECT_LT(c.bodies_largest_px, 0.1);
        EXPECT_LT(std::abs(c.edges.mean_px), 0.02);
        EXPECT_LT(std::abs(c.bias), c.rmse / 5);
        ASSERT_TRUE(c.predicted_over_measured);
        EXPECT_GT(*c.predicted_over_measured, 0.5);
        EXPECT_LT(*c.predicted_over_measured, 2.0);
    }
    EXPECT_LT(costs.back().bodies_largest_px, 0.01);
}

/// Of pictures that are shifted by 0.3 px the shift is told, with its sign.
TEST_F(ReplayTest, AShiftedPictureShowsItsShift) {
    const std::string log = run(scene_with("spp = 64", kWhole[0], kWhole[1]), 1);
    // A principal point 0.3 px to the right shifts the picture so far: the log's poses with another camera's scene.
    const std::string text = scene_with("spp = 64", kWhole[0], kWhole[1]);
    const double fx = 96 / (2 * std::tan(20 * M_PI / 180));
    std::string shifted = text;
    const std::string angle = "fov_horizontal_deg = 40";
    shifted.replace(shifted.find(angle), angle.size(),
                    fmt::format("intrinsics = {{fx = {0}, fy = {0}, cx = 47.8, cy = 39.5}}", fx));
    std::ofstream(folder_ / "shifted.toml") << shifted;
    auto moved = Replay::open(log, "", folder_ / "shifted.toml");
    ASSERT_TRUE(moved) << moved.error().text();
    const auto replay = open(log);
    ASSERT_TRUE(replay);
    EXPECT_TRUE(replay->make(0).empty());
    EXPECT_FALSE((*moved)->make(0).empty());
    const ReferenceComparison straight = replay->against(64);
    std::vector<std::int32_t> body(96 * 80, -1);
    for (std::size_t i = 0; i < body.size(); ++i)
        if (mean_band(vec_cast<double>(replay->picture().pixels[i])) > 0) body[i] = 0;
    const ImageDifference off =
        compare((*moved)->picture(), replay->reference(), body, straight.difference.full_scale);
    ASSERT_EQ(off.bodies.size(), 1U);
    EXPECT_NEAR(off.bodies[0].x_px, 0.3, 0.02);
    EXPECT_NEAR(off.bodies[0].y_px, 0.0, 0.02);
    EXPECT_GT(off.edges.rms_px, 5 * straight.difference.edges.rms_px);
}

TEST(BudgetCost, IsTheMeanOverFramesOfWhatEachCost) {
    const auto frame = [](double rmse, double expected, double noise, double x_px) {
        ReplayedFrame f;
        f.logged.ledger.expected_error = static_cast<float>(expected);
        f.compared = ReferenceComparison{};
        f.compared->difference.rmse = 2 * rmse;  // of a full scale of 2
        f.compared->difference.full_scale = 2;
        f.compared->difference.bias = -rmse;
        f.compared->difference.ssim = 1 - rmse;
        f.compared->difference.edges = {100, x_px, 2 * x_px, 3 * x_px};
        f.compared->difference.bodies = {{0, x_px, 0}};
        f.compared->reference_error = 2 * noise;
        return f;
    };
    const std::vector<ReplayedFrame> frames{frame(0.05, 0.02, 0.03, 0.1), frame(0.1, -1, 0.06, 0.3)};
    const BudgetCost c = budget_cost(frames);
    EXPECT_NEAR(c.rmse, std::sqrt((0.05 * 0.05 + 0.1 * 0.1) / 2), 1e-12);
    EXPECT_DOUBLE_EQ(c.rmse_largest, 0.1);
    EXPECT_NEAR(c.bias, -0.0375, 1e-12);
    EXPECT_NEAR(c.ssim_mean, 0.925, 1e-12);
    EXPECT_DOUBLE_EQ(c.ssim_min, 0.9);
    EXPECT_NEAR(c.edges.mean_px, 0.2, 1e-12);
    EXPECT_NEAR(c.edges.rms_px, std::sqrt((0.2 * 0.2 + 0.6 * 0.6) / 2), 1e-12);
    EXPECT_NEAR(c.edges.p99_px, 0.9, 1e-12);
    EXPECT_NEAR(c.bodies_x_px, 0.2, 1e-12);
    EXPECT_NEAR(c.bodies_largest_px, 0.3, 1e-12);
    // The first frame alone has an estimate: 0.02 of sqrt(0.05^2 - 0.03^2) = 0.04.
    ASSERT_TRUE(c.predicted_over_measured);
    EXPECT_NEAR(*c.predicted_over_measured, 0.5, 1e-6);
    EXPECT_NEAR(*frames[0].predicted_over_measured(), 0.5, 1e-6);
    EXPECT_FALSE(frames[1].predicted_over_measured());
}

// --- The program ------------------------------------------------------------

Done replay(const std::string& arguments, const char* streams) {
    return test::run_command(std::string(test::kTimeLimit) + NARPA_BIN + " replay " + arguments + streams);
}

TEST_F(ReplayTest, TheProgramReportsHowManyFramesRepeat) {
    const std::string log = run(scene_with("budget_rays = 20000"));
    const Done good = replay(log + " --json", " 2>/dev/null");
    EXPECT_EQ(good.status, 0);
    const json all = json::parse(good.out);
    EXPECT_EQ(all["frames_replayed"], 5);
    EXPECT_EQ(all["frames_repeated"], 5);

    set_cell(log, 4, "image_crc32", "deadbeef");
    const Done bad = replay(log, " 2>&1");
    EXPECT_EQ(bad.status, 1);
    EXPECT_NE(bad.out.find("4 of 5 frames repeat bit for bit"), std::string::npos) << bad.out;
    EXPECT_NE(bad.out.find("nav.ledger.csv:5: frame 3: image_crc32: "), std::string::npos) << bad.out;
    EXPECT_NE(bad.out.find(", logged deadbeef"), std::string::npos) << bad.out;
}

TEST_F(ReplayTest, TheProgramFindsNothingProvedWhereNothingIsRepeated) {
    const std::string log = run(scene_with("budget_rays = 1"), 2);  // too few for the coarsest image
    const Done nothing = replay(log + " --json", " 2>/dev/null");
    EXPECT_EQ(nothing.status, 1);
    const json document = json::parse(nothing.out);
    EXPECT_FALSE(document["passed"].get<bool>());
    EXPECT_EQ(document["frames_replayed"], 0);
    EXPECT_EQ(document["frames_not_whole"], 2);
    EXPECT_TRUE(document["frames"].empty());  // what there is of the log is true
}

/// A frame that got nowhere took nothing: a whole one cannot be hidden behind that step.
TEST_F(ReplayTest, TheProgramChecksFramesWithoutAnImageToo) {
    const std::string log = run(scene_with("budget_rays = 20000"));
    set_cell(log, 4, "step", "5");
    const Done bad = replay(log, " 2>&1");
    EXPECT_EQ(bad.status, 1);
    EXPECT_NE(bad.out.find("4 of 4 frames repeat bit for bit"), std::string::npos) << bad.out;
    for (const char* words :
         {"nav.ledger.csv:5: frame 3: samples: 0, logged ", "; rays: 0, logged ", "; passes: none"})
        EXPECT_NE(bad.out.find(words), std::string::npos) << words << "\n" << bad.out;
}

TEST_F(ReplayTest, TheProgramComparesAndPaints) {
    const std::string log = run(scene_with("budget_rays = 20000", kWhole[0], kWhole[1]));
    const std::string picture = folder_ / "cost.png";
    const Done done = replay(log + " --reference 32 --frames 3 --json -o " + picture, " 2>/dev/null");
    EXPECT_EQ(done.status, 0);
    const json document = json::parse(done.out);
    ASSERT_EQ(document["frames"].size(), 3U);
    EXPECT_EQ(document["frames"][0]["frame"], 0);
    EXPECT_EQ(document["frames"][1]["frame"], 2);
    EXPECT_EQ(document["frames"][2]["frame"], 4);
    EXPECT_EQ(document["cost"]["frames"], 3);
    EXPECT_GT(document["cost"]["rmse"], 0);
    EXPECT_EQ(document.at("/frames/0/bodies/0/body"_json_pointer), "target");
    EXPECT_GT(std::filesystem::file_size(picture), 2000U);
    EXPECT_EQ(replay(log + " -o " + picture, " 2>/dev/null").status, 2);  // nothing to compare with
    EXPECT_EQ(replay((folder_ / "nowhere"), " 2>/dev/null").status, 2);
}

}  // namespace
}  // namespace narpa::test
