// A user's own DBC file: signals against canmatrix, errors with lines, and poses from several messages.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>

#include "protocols/can/pose_map.h"
#include "tests/support/can_frames.h"

namespace narpa {
namespace {

const std::string kDbc = R"(VERSION ""
BS_:
BU_: SIM NAV
BO_ 291 ATT: 8 SIM
 SG_ Q0 : 7|16@0- (3.0517578125E-05,0) [-1|1] "" NAV
 SG_ Q1 : 23|16@0- (3.0517578125E-05,0) [-1|1] "" NAV
 SG_ Q2 : 35|13@0- (0.000244140625,0) [0|0] "" NAV
 SG_ MODE : 54|3@0+ (1,2) [0|0] "" NAV
 SG_ T : 57|6@1+ (0.5,-3) [0|0] "ms" NAV
BO_ 2566844926 POS: 8 SIM
 SG_ X : 3|21@1- (0.001,100) [0|0] "km" NAV
 SG_ Y : 24|24@1+ (0.25,0) [0|0] "m" NAV
 SG_ F : 63|5@0- (1,0) [0|0] "m" NAV
CM_ BO_ 291 "a comment of
BO_ two lines";
)";

std::vector<DbcMessage> read(const std::string& text) {
    auto all = read_dbc(text, "bus.dbc");
    EXPECT_TRUE(all) << all.error().text();
    return all ? *std::move(all) : std::vector<DbcMessage>{};
}

double value_of(const DbcMessage& m, const std::string& signal, std::string_view hex) {
    std::vector<std::uint8_t> data;
    for (std::size_t i = 0; i < hex.size(); i += 2)
        data.push_back(static_cast<std::uint8_t>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
    for (const DbcSignal& s : m.signals)
        if (s.name == signal) return s.value(data);
    ADD_FAILURE() << "no signal " << signal;
    return 0;
}

TEST(CanDbcReader, ReadsWhatTheFileStates) {
    const auto all = read(kDbc);
    ASSERT_EQ(all.size(), 2u);
    EXPECT_EQ(all[0].name, "ATT");
    EXPECT_EQ(all[0].id, 0x123u);
    EXPECT_FALSE(all[0].extended);
    EXPECT_EQ(all[0].signals.size(), 5u);
    EXPECT_EQ(all[1].id, 0x18FEF1FEu);
    EXPECT_TRUE(all[1].extended);
    EXPECT_EQ(all[1].signals[0].unit, "km");
}

// The values that canmatrix 0.9.5 decodes from random data.
TEST(CanDbcReader, SignalsHaveTheValuesOfCanmatrix) {
    const auto all = read(kDbc);
    ASSERT_EQ(all.size(), 2u);
    const std::map<std::string, std::map<std::string, double>> att{
        {"7942bdf22106f084",
         {{"Q0", 0.94732666015625}, {"Q1", -0.51605224609375}, {"Q2", 0.128173828125}, {"MODE", 9}, {"T", -2}}},
        {"7762f0f3cb4d764d",
         {{"Q0", 0.93267822265625}, {"Q1", -0.117584228515625}, {"Q2", -0.58740234375}, {"MODE", 9}, {"T", 16}}},
        {"c7072051159a0f89",
         {{"Q0", -0.445098876953125}, {"Q1", 0.252471923828125}, {"Q2", 0.7001953125}, {"MODE", 2}, {"T", -1}}}};
    const std::map<std::string, std::map<std::string, double>> pos{
        {"f2c6dacae344bb31", {{"X", -204.93}, {"Y", 1128690.5}, {"F", 6}}},
        {"1245fd6f84df9ad7", {{"X", 77.634}, {"Y", 3662107.75}, {"F", -6}}},
        {"c5b3d076ac0e8f53", {{"X", -287.464}, {"Y", 240413.5}, {"F", 10}}}};
    for (const auto& [hex, values] : att)
        for (const auto& [name, value] : values)
            EXPECT_DOUBLE_EQ(value_of(all[0], name, hex), value) << name << " " << hex;
    for (const auto& [hex, values] : pos)
        for (const auto& [name, value] : values)
            EXPECT_NEAR(value_of(all[1], name, hex), value, 1e-9) << name << " " << hex;
}

TEST(CanDbcReader, ReadsFloats) {
    const auto all = read(
        "BO_ 1 M: 16 X\n SG_ D : 0|64@1- (2,1) [0|0] \"m\" X\n SG_ F : 64|32@1- (1,0) [0|0] \"m\" X\n"
        "SIG_VALTYPE_ 1 D : 2;\nSIG_VALTYPE_ 1 F : 1;\n");
    std::vector<std::uint8_t> data(16);
    const double d = -1234.5678;
    const float f = 0.1f;
    std::memcpy(data.data(), &d, 8);
    std::memcpy(data.data() + 8, &f, 4);
    EXPECT_EQ(all[0].signals[0].value(data), 1 + 2 * d);
    EXPECT_EQ(all[0].signals[1].value(data), static_cast<double>(f));
}

TEST(CanDbcReader, ErrorsNameThePlace) {
    const auto expect_error = [](const std::string& text, const std::string& words) {
        const auto all = read_dbc(text, "bus.dbc");
        ASSERT_FALSE(all) << text;
        EXPECT_NE(all.error().text().find(words), std::string::npos) << all.error().text();
    };
    const std::string message = "BO_ 1 M: 8 X\n";
    expect_error("BO_ x M: 8 X", "bus.dbc:1:5: expected a message");
    expect_error("BO_ 2048 M: 8 X", "no CAN identifier");
    expect_error("BO_ 1 M: 65 X", "expected 0 to 64 bytes");
    expect_error(" SG_ A : 0|8@1+ (1,0) [0|0] \"\" X", "a signal before the first message");
    expect_error(message + " SG_ A : 0|8@1 (1,0) [0|0] \"\" X", "bus.dbc:2:");
    expect_error(message + " SG_ A : 57|8@1+ (1,0) [0|0] \"\" X", "A: lies outside of M, which has 8 bytes");
    expect_error(message + " SG_ A : 56|9@0+ (1,0) [0|0] \"\" X", "A: lies outside of M");
    expect_error(message + " SG_ A : 0|65@1+ (1,0) [0|0] \"\" X", "expected 1 to 64 bits");
    expect_error(message + " SG_ A : 0|0@1+ (1,0) [0|0] \"\" X", "expected 1 to 64 bits");
    expect_error(message + " SG_ A : 0|8@1+ (1,0) [0|0] X", "expected a signal");
    expect_error(message + " SG_ A : 0|8@1+ (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 1 A : 1;",
                 "expected 1 for a float of 32 bits");
}

/// Position in centimetres and time in one message, attitude in two.
PoseMap two_messages() {
    const auto all = read(
        "BO_ 256 P: 8 X\n SG_ X : 0|16@1- (1,0) [0|0] \"cm\" X\n SG_ Y : 16|16@1- (1,0) [0|0] \"cm\" X\n"
        " SG_ Z : 32|16@1- (1,0) [0|0] \"cm\" X\n SG_ T : 48|16@1+ (1,0) [0|0] \"ms\" X\n"
        "BO_ 2147484000 Q: 8 X\n SG_ W : 0|16@1- (0.0001,0) [0|0] \"\" X\n"
        " SG_ X : 16|16@1- (0.0001,0) [0|0] \"\" X\n SG_ Y : 32|16@1- (0.0001,0) [0|0] \"\" X\n"
        " SG_ Z : 48|16@1- (0.0001,0) [0|0] \"\" X\n");
    PoseMap map{.messages = all};
    for (std::size_t i = 0; i < 3; ++i)
        map.position[i] = {0, all[0].signals[i], *si_factor(PoseQuantity::position, all[0].signals[i].unit)};
    for (std::size_t i = 0; i < 4; ++i) map.attitude_wxyz[i] = {1, all[1].signals[i], 1};
    map.time = {0, all[0].signals[3], *si_factor(PoseQuantity::time, "ms")};
    return map;
}
CanFrame of_shorts(std::uint32_t id, bool extended, std::array<int, 4> values) {
    CanFrame f{.id = id, .extended = extended, .size = 8};
    for (std::size_t i = 0; i < 4; ++i) {
        f.data[2 * i] = static_cast<std::uint8_t>(values[i]);
        f.data[2 * i + 1] = static_cast<std::uint8_t>(values[i] >> 8);
    }
    return f;
}

TEST(CanPoseMap, ACommandIsCompleteWhenEachMessageHasCome) {
    MappedPoseDecoder decoder(std::make_shared<PoseMap>(two_messages()));
    PoseCommand command;
    const auto position = [](int x, int t) { return of_shorts(256, false, {x, -200, 300, t}); };
    const CanFrame attitude = of_shorts(352, true, {6000, 8000, 0, 0});
    EXPECT_EQ(decoder.accept(position(100, 1500), 0, command), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(attitude, 0, command), PoseStatus::complete);
    EXPECT_EQ(command.t_valid_ns, 1'500'000'000);
    EXPECT_EQ(command.counter, 0);
    EXPECT_EQ(command.motion.T_world_body.t, (Vec3{1, -2, 3}));
    EXPECT_NEAR(command.motion.T_world_body.q.w, 0.6, 1e-12);
    EXPECT_NEAR(command.motion.T_world_body.q.x, 0.8, 1e-12);
    // The other order; a message that comes again replaces the first.
    EXPECT_EQ(decoder.accept(attitude, 0, command), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(attitude, 0, command), PoseStatus::partial);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 1u);
    EXPECT_EQ(decoder.accept(position(101, 1600), 0, command), PoseStatus::complete);
    EXPECT_EQ(command.counter, 1);
    EXPECT_EQ(command.motion.T_world_body.t.x, 1.01);
}

TEST(CanPoseMap, ATimeThatWrapsIsTheNearest) {
    MappedPoseDecoder decoder(std::make_shared<PoseMap>(two_messages()));
    PoseCommand command;
    const CanFrame attitude = of_shorts(352, true, {10000, 0, 0, 0});
    for (const std::int64_t t_ms : {0LL, 65'535LL, 65'536LL, 1'000'000LL, 86'400'000LL})
        for (const std::int64_t late_ms : {-30'000LL, 0LL, 30'000LL}) {
            (void)decoder.accept(of_shorts(256, false, {0, 0, 0, static_cast<int>(t_ms % 65'536)}), 0, command);
            ASSERT_EQ(decoder.accept(attitude, (t_ms + late_ms) * 1'000'000, command), PoseStatus::complete);
            EXPECT_EQ(command.t_valid_ns, t_ms * 1'000'000) << t_ms << " " << late_ms;
        }
}

TEST(CanPoseMap, RefusesWhatIsNoPoseAndCountsIt) {
    MappedPoseDecoder decoder(std::make_shared<PoseMap>(two_messages()));
    PoseCommand command;
    CanFrame position = of_shorts(256, false, {0, 0, 0, 0});
    EXPECT_EQ(decoder.accept(of_shorts(256, true, {0, 0, 0, 0}), 0, command), PoseStatus::not_mine) << "29 bits";
    position.size = 7;
    EXPECT_EQ(decoder.accept(position, 0, command), PoseStatus::too_short);
    position.size = 8, position.remote = true;
    EXPECT_EQ(decoder.accept(position, 0, command), PoseStatus::wrong_kind);
    position.remote = false;
    EXPECT_EQ(decoder.accept(position, 0, command), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(of_shorts(352, true, {9000, 0, 0, 0}), 0, command), PoseStatus::not_unit);
    EXPECT_EQ(decoder.count(PoseStatus::not_unit), 1u);
}

TEST(CanPoseMap, TheAttitudeMayBeTheInverse) {
    PoseMap map = two_messages();
    map.world_to_body = true;
    MappedPoseDecoder decoder(std::make_shared<PoseMap>(map));
    PoseCommand command;
    (void)decoder.accept(of_shorts(256, false, {0, 0, 0, 0}), 0, command);
    ASSERT_EQ(decoder.accept(of_shorts(352, true, {6000, 8000, 0, 0}), 0, command), PoseStatus::complete);
    EXPECT_NEAR(command.motion.T_world_body.q.x, -0.8, 1e-12);
}

TEST(CanPoseMap, UnitsAreThoseOfTheirQuantity) {
    EXPECT_EQ(si_factor(PoseQuantity::position, "km"), 1e3);
    EXPECT_EQ(si_factor(PoseQuantity::position, ""), 1);
    EXPECT_NEAR(*si_factor(PoseQuantity::rate, "deg/s"), 0.017453292519943295, 1e-18);
    EXPECT_FALSE(si_factor(PoseQuantity::position, "deg"));
    EXPECT_FALSE(si_factor(PoseQuantity::time, "m"));
}

}  // namespace
}  // namespace narpa
