// narpa.dbc is what the tables say, and a reader that others wrote understands it as we do.
#include "protocols/can/dbc.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "protocols/can/candump.h"
#include "tests/protocols/can_support.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa {
namespace {

constexpr std::uint32_t kChaserBase = 0x100;
const std::string kDbcPath = test::source_path("protocols/can/narpa.dbc");

std::string shipped_text() {
    return test::read_text(kDbcPath);
}

TEST(CanDbc, ShippedFileIsTheGeneratedOne) {
    const std::array<CanBody, 1> bodies{{{"chaser", kChaserBase}}};
    const std::string generated = write_dbc(bodies);
    if (generated == shipped_text()) return;
    const std::string path = test::build_path("narpa.dbc");
    std::ofstream(path) << generated;
    ADD_FAILURE() << kDbcPath << " differs from what the messages say; the new text is in " << path;
}

TEST(CanDbc, NamesBecomeSymbols) {
    const std::array<CanBody, 2> bodies{{{"7 of 9", 0x20}, {"port-side", 0x30}}};
    const std::string text = write_dbc(bodies, 2);
    EXPECT_NE(text.find("BO_ 32 _7_of_9_Time: 8 Commander\n"), std::string::npos);
    EXPECT_NE(text.find("BO_ 63 port_side_Pose: 64 Commander\n"), std::string::npos);
    EXPECT_NE(text.find("BO_ 1567 Camera1_Ledger: 64 narpa\n"), std::string::npos);
}

/// Names of messages, and of SystemMessageLongSymbol where they have it.
std::map<std::string, std::string> names_in(const std::string& dbc) {
    std::map<std::string, std::string> by_id, names;
    std::istringstream lines(dbc);
    for (std::string line, word, id, name; std::getline(lines, line);) {
        std::istringstream words(line);
        words >> word >> id >> name;
        if (word == "BO_") {
            EXPECT_TRUE(names.emplace(by_id[id] = name.substr(0, name.size() - 1), "").second) << line;
        }
        if (word == "BA_" && id == "\"SystemMessageLongSymbol\"") {
            std::string of, symbol;
            words >> of >> symbol;
            EXPECT_EQ(name, "BO_") << line;
            names[by_id[of]] = symbol.substr(1, symbol.size() - 3);
        }
    }
    return names;
}

TEST(CanDbc, NamesDifferAndHaveAtMost32Characters) {
    const std::string longest(60, 'a');
    const std::vector<CanBody> bodies{{"pod-1", 0x20},   {"pod.1", 0x40},       {"pod_1", 0x60},
                                      {longest, 0x80},   {longest + "b", 0xa0}, {"1st", 0xc0},
                                      {"Camera0", 0xe0}, {"pod_1_2", 0x100},    {"Satellite \"x\"", 0x120}};
    const std::string text = write_dbc(bodies, 2);
    const auto names = names_in(text);
    std::set<std::string> longs;
    for (const auto& [name, symbol] : names) {
        EXPECT_LE(name.size(), 32u) << name;
        EXPECT_TRUE(symbol.empty() || symbol.size() > name.size()) << symbol;
        if (!symbol.empty()) {
            EXPECT_TRUE(longs.insert(symbol).second) << symbol;
        }
    }
    EXPECT_TRUE(names.contains("pod_1_Time") && names.contains("pod_1_3_Time") && names.contains("pod_1_4_Time"));
    EXPECT_NE(text.find("BO_ 96 pod_1_Time:"), std::string::npos) << "a name that needs no change keeps it";
    EXPECT_TRUE(longs.contains(longest + "_Time") && longs.contains(longest + "b_Time"));
    EXPECT_NE(text.find(" Body: pod-1.\";"), std::string::npos);
}

/// Runs can_dbc_reader.py with Debian's python; exit 77 means that canmatrix is not there.
struct Python {
    std::string out;
    int status = -1;
};
Python run_reader(const std::string& arguments) {
    Python python;
    const std::string command = "/usr/bin/python3 " + test::source_path("tests/protocols/can_dbc_reader.py ") +
                                kDbcPath + " " + arguments + " 2>&1";
    FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) return python;
    std::array<char, 4096> part;
    while (const std::size_t n = std::fread(part.data(), 1, part.size(), pipe)) python.out.append(part.data(), n);
    const int status = ::pclose(pipe);
    python.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return python;
}
bool cannot_run(const Python& python) {
    return python.status == 77 || python.status == 127;
}

// canmatrix encodes a pose by the DBC alone; our decoder reads what our own encoder would have said.
TEST(CanDbc, CanmatrixEncodesWhatWeDecode) {
    std::mt19937_64 rng(31);
    std::vector<PoseCommand> commands;
    std::string arguments = "encode";
    for (int i = 0; i < 20; ++i) {
        const PoseCommand& c = commands.emplace_back(random_command(rng, i == 0 ? 1.4e8 : 1e4));
        const Motion& m = c.motion;
        const Quat& q = m.T_world_body.q;
        std::array<char, 512> text;
        std::snprintf(text.data(), text.size(), " %d,%lld", c.counter, static_cast<long long>(c.t_valid_ns));
        arguments += text.data();
        for (const double v :
             {m.T_world_body.t.x, m.T_world_body.t.y, m.T_world_body.t.z, q.w, q.x, q.y, q.z, m.velocity_m_s.x,
              m.velocity_m_s.y, m.velocity_m_s.z, m.rate_rad_s.x, m.rate_rad_s.y, m.rate_rad_s.z}) {
            std::snprintf(text.data(), text.size(), ",%.17g", v);
            arguments += text.data();
        }
    }
    const Python python = run_reader(arguments);
    if (cannot_run(python)) GTEST_SKIP() << "no canmatrix: " << python.out;
    ASSERT_EQ(python.status, 0) << python.out;

    std::istringstream lines(python.out);
    std::string text;
    PoseDecoder decoder(kChaserBase);
    for (const PoseCommand& sent : commands) {
        FrameSet frames;
        PoseCommand expected, out;
        ASSERT_TRUE(encode_classic(sent, kChaserBase, frames));
        ASSERT_EQ(decode_all(frames, kChaserBase, sent.t_valid_ns, expected), PoseStatus::complete);
        std::vector<CanFrame> theirs;
        for (int i = 0; i < 10; ++i) {
            CandumpLine line;
            ASSERT_TRUE(std::getline(lines, text));
            ASSERT_EQ(parse_candump(text, line), nullptr) << text;
            theirs.push_back(line.frame);
        }
        const std::span<const CanFrame> all(theirs);
        ASSERT_EQ(decode_all(all.first(9), kChaserBase, sent.t_valid_ns, out), PoseStatus::complete) << text;
        ASSERT_TRUE(same(out, expected)) << "classic";
        ASSERT_EQ(decode_all(all.last(1), kChaserBase, sent.t_valid_ns, out), PoseStatus::complete) << text;
        ASSERT_TRUE(same(out, expected)) << "FD";
    }
}

// canmatrix decodes our telemetry by the DBC alone.
TEST(CanDbc, CanmatrixDecodesWhatWeEncode) {
    FrameLedger ledger;
    ledger.frame = 123456789;
    ledger.pose_counter = 200;
    ledger.pose_stale = true;
    ledger.delivery = Delivery::repeated;
    ledger.step = 3;
    ledger.budget_kind = BudgetKind::time;
    ledger.budget = 60'000'000;
    ledger.samples = 19'699'200;
    ledger.rays = 41'234'567;
    ledger.passes = {307'200, 19'392'000};
    ledger.samples_per_pixel = 64.125f;
    ledger.expected_error = 0.0078125f;
    ledger.t_exposure_mid_ns = 5'000'000'000;
    ledger.t_pose_ns = 4'990'000'000;
    ledger.t_exposure_start_ns = 4'995'000'000;
    ledger.t_exposure_end_ns = 5'005'000'000;
    ledger.t_render_start_ns = 5'005'100'000;
    ledger.t_render_end_ns = 5'055'000'000;
    ledger.t_hand_over_ns = 5'056'000'000;
    ledger.t_deadline_ns = 5'100'000'000;
    Heartbeat heartbeat{.t_ns = 5'000'000'000, .state = RunState::lockstep, .stale = true, .counter = 9};

    std::vector<CanFrame> frames{encode_fd(ledger), encode(heartbeat)};
    for (const CanFrame& f : encode_classic(ledger)) frames.push_back(f);
    std::string arguments = "decode";
    for (const CanFrame& f : frames) {
        std::array<char, kCandumpMaxLine> line;
        const std::size_t n = format_candump({0, f}, "x", line);
        const std::string text(line.data(), n - 1);
        arguments += " '" + text.substr(text.rfind(' ') + 1) + "'";
    }
    const Python python = run_reader(arguments);
    if (cannot_run(python)) GTEST_SKIP() << "no canmatrix: " << python.out;
    ASSERT_EQ(python.status, 0) << python.out;

    std::map<std::string, std::string> got;  // "message.signal" -> value
    std::istringstream lines(python.out);
    for (std::string key, value; lines >> key >> value;) got[key] = value;
    const std::map<std::string, std::string> quantities{
        {"Frame", "123456789"},         {"Camera", "0"},
        {"PoseCounter", "200"},         {"ExposureMid", "5000000000"},
        {"PoseTime", "4990000000"},     {"ExposureStart", "-5000"},
        {"ExposureEnd", "5000"},        {"RenderStart", "5100"},
        {"RenderEnd", "55000"},         {"HandOver", "56000"},
        {"Deadline", "100000"},         {"SamplesPerPixel", "64.125"},
        {"ExpectedError", "0.0078126"}, {"PoseStale", "1"},
        {"DeadlineMet", "1"},           {"PoseKnown", "1"},
        {"Step", "coarse_2"},           {"BudgetKind", "time"},
        {"Delivery", "repeated"},       {"Passes", "2"},
        {"Samples", "19699200"},        {"Rays", "41234567"},
        {"Budget", "60000000"}};
    for (const Signal& s : kLedgerSignals) {
        const std::string signal(s.name), classic(kLedgerFrames[s.classic.frame]);
        EXPECT_EQ(got["Camera0_Ledger." + signal], quantities.at(signal));
        EXPECT_EQ(got["Camera0_" + classic + "." + signal], quantities.at(signal));
    }
    EXPECT_EQ(got["Heartbeat.Time"], "5000000");
    EXPECT_EQ(got["Heartbeat.State"], "lockstep");
    EXPECT_EQ(got["Heartbeat.Stale"], "1");
    EXPECT_EQ(got["Heartbeat.NoCommand"], "0");
    EXPECT_EQ(got["Heartbeat.Counter"], "9");
}

}  // namespace
}  // namespace narpa
