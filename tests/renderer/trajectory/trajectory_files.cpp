// Trajectories of files in the formats of flight dynamics: orbit and attitude ephemerides, tables. The files are
// made here, of motions in closed form.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "renderer/ephemeris/time_systems.h"
#include "renderer/trajectory/trajectory.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

constexpr double kRadius_m = 6778137, kRate_rad_s = 1.1313e-3, kTurn_rad_s = 0.01;

/// A circular orbit, inclined; t in s.
Vec3 orbit_m(double t_s) {
    const double u = kRate_rad_s * t_s;
    return kRadius_m * Vec3{std::cos(u), 0.6 * std::sin(u), 0.8 * std::sin(u)};
}
Vec3 orbit_m_s(double t_s) {
    const double u = kRate_rad_s * t_s;
    return kRate_rad_s * kRadius_m * Vec3{-std::sin(u), 0.6 * std::cos(u), 0.8 * std::cos(u)};
}
/// Body to inertial, turning about an axis of the body.
const Vec3 kAxis = normalized(Vec3{1, 2, -2});
Quat turning(double t_s) {
    return normalized(Quat{0.5, 0.1, -0.3, 0.8}) * exp_rotation((kTurn_rad_s * t_s) * kAxis);
}

std::string utc(double s) {
    const int whole = static_cast<int>(std::floor(s));
    return fmt::format("2026-03-01T12:{:02}:{:02}.{:06}", whole / 60, whole % 60,
                       static_cast<int>(std::llround((s - whole) * 1e6)));
}

struct Oem {
    std::string frame = "ICRF", system = "UTC",
                interpolation = "INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 7\n";
    std::string more{};  ///< after the data
    Vec3 offset_m{};
    std::function<std::string(double)> time = utc;
    double step_s = 20;

    [[nodiscard]] std::string text() const {
        std::string s = fmt::format(
            "CCSDS_OEM_VERS = 2.0\nCOMMENT made by a test\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = "
            "NARPA\n\n"
            "META_START\nOBJECT_NAME = STATION\nOBJECT_ID = 1998-067A\nCENTER_NAME = EARTH\nREF_FRAME = {}\n"
            "TIME_SYSTEM = {}\nSTART_TIME = {}\nSTOP_TIME = {}\n{}META_STOP\n",
            frame, system, time(0), time(600), interpolation);
        for (double t = 0; t <= 600; t += step_s) {
            const Vec3 p = 1e-3 * (orbit_m(t) + offset_m), v = 1e-3 * orbit_m_s(t);
            s += fmt::format("{} {:.12f} {:.12f} {:.12f} {:.15f} {:.15f} {:.15f}\n", time(t), p.x, p.y, p.z, v.x,
                             v.y, v.z);
        }
        return s + more;
    }
};

struct Aem {
    std::string version = "1.0", a = "ICRF", b = "SC_BODY_1";
    std::string keys =
        "ATTITUDE_DIR = A2B\nATTITUDE_TYPE = QUATERNION\nQUATERNION_TYPE = LAST\n"
        "INTERPOLATION_METHOD = LAGRANGE\nINTERPOLATION_DEGREE = 5\n";
    std::function<std::string(const Quat&)> row = [](const Quat& q) {
        return fmt::format("{:.15f} {:.15f} {:.15f} {:.15f}", q.x, q.y, q.z, q.w);
    };

    [[nodiscard]] std::string text() const {
        std::string s = fmt::format(
            "CCSDS_AEM_VERS = {}\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = NARPA\nMETA_START\nOBJECT_NAME "
            "= STATION\n"
            "OBJECT_ID = 1998-067A\nREF_FRAME_A = {}\nREF_FRAME_B = {}\nTIME_SYSTEM = UTC\nSTART_TIME = "
            "{}\nSTOP_TIME = {}\n"
            "{}META_STOP\nDATA_START\n",
            version, a, b, utc(0), utc(600), keys);
        for (int k = 0; k <= 60; ++k)  // signs alternate: they mean nothing
            s += utc(10 * k) + " " + row(k % 3 == 1 ? -turning(10 * k) : turning(10 * k)) + "\n";
        return s + "DATA_STOP\n";
    }
};

class TrajectoryFiles : public ::testing::Test {
protected:
    static std::string head(const std::string& more = "") {
        return "[trajectory]\nepoch = 2026-03-01T12:00:00Z\nstep_s = 7.5\n" + more;
    }
    Result<std::vector<TrajectoryRow>> read(const std::string& description) const {
        return read_trajectory(folder_.write("t.toml", description));
    }
    /// One body of an OEM and an AEM.
    Result<std::vector<TrajectoryRow>> read(const Oem& oem, const Aem& aem = {},
                                            const std::string& world = "") const {
        folder_.write("a.oem", oem.text());
        folder_.write("a.aem", aem.text());
        return read(head() + world + "[[body]]\nname = \"station\"\noem = \"a.oem\"\naem = \"a.aem\"\n");
    }
    /// The largest errors of rows against the motion: position, velocity, attitude, rate.
    static void expect_motion(const std::vector<TrajectoryRow>& rows, double m, double m_s, double rad,
                              double rad_s, const Quat& q_world = {}) {
        ASSERT_GT(rows.size(), 70u);
        for (const TrajectoryRow& row : rows) {
            const double t = 1e-9 * static_cast<double>(row.t_ns);
            ASSERT_LT(norm(row.motion.T_world_body.t - q_world * orbit_m(t)), m) << t;
            ASSERT_LT(norm(row.motion.velocity_m_s - q_world * orbit_m_s(t)), m_s) << t;
            ASSERT_LT(angle_between(row.motion.T_world_body.q, q_world * turning(t)), rad) << t;
            ASSERT_LT(norm(row.motion.rate_rad_s - kTurn_rad_s * kAxis), rad_s) << t;
        }
    }
    /// The error of the file with this name, at a line that holds this text.
    void expect_error(const Result<std::vector<TrajectoryRow>>& read, const std::string& file,
                      const std::string& line, const std::string& what) const {
        ASSERT_FALSE(read) << "expected: " << what;
        EXPECT_NE(read.error().what.find(what), std::string::npos) << read.error().text();
        EXPECT_EQ(read.error().file, folder_ / file) << read.error().text();
        if (line.empty()) return;
        std::ifstream in(folder_ / file);
        std::string text;
        for (int i = 0; i < read.error().line; ++i) std::getline(in, text);
        EXPECT_NE(text.find(line), std::string::npos) << read.error().text() << "\n" << text;
    }
    test::TemporaryFolder folder_;
};

TEST_F(TrajectoryFiles, EphemeridesAreInterpolatedAsTheySay) {
    const auto rows = read(Oem{});
    ASSERT_TRUE(rows) << rows.error().text();
    EXPECT_EQ(rows->front().t_ns, 0);
    EXPECT_EQ(rows->back().t_ns, 600'000'000'000);
    expect_motion(*rows, 1e-5, 1e-6, 1e-7, 1e-8);
}

TEST_F(TrajectoryFiles, EachMethodHasItsOrder) {
    // Largest errors of a circular orbit with steps of 20 s: n^2 r h^2 / 8 for LINEAR.
    const double linear_m = kRate_rad_s * kRate_rad_s * kRadius_m * 20 * 20 / 8;
    for (const auto& [method, least, most] : {std::tuple{"LINEAR", 0.5 * linear_m, 1.01 * linear_m},
                                              {"LAGRANGE\nINTERPOLATION_DEGREE = 3", 1e-4, 1e-1},
                                              {"HERMITE\nINTERPOLATION_DEGREE = 3", 1e-4, 5e-2},
                                              {"LAGRANGE\nINTERPOLATION_DEGREE = 9", 0.0, 1e-5}}) {
        const auto rows = read(Oem{.interpolation = fmt::format("INTERPOLATION = {}\n", method)});
        ASSERT_TRUE(rows) << rows.error().text();
        double largest = 0;
        for (const TrajectoryRow& row : *rows)
            largest =
                std::max(largest, norm(row.motion.T_world_body.t - orbit_m(1e-9 * static_cast<double>(row.t_ns))));
        EXPECT_GE(largest, least) << method;
        EXPECT_LE(largest, most) << method;
    }
}

TEST_F(TrajectoryFiles, AttitudesOfEachConventionAreTheSame) {
    const auto first = [](const Quat& q) {
        return fmt::format("{:.15f} {:.15f} {:.15f} {:.15f}", q.w, q.x, q.y, q.z);
    };
    const std::string lagrange =
        "ATTITUDE_TYPE = QUATERNION\nINTERPOLATION_METHOD = LAGRANGE\nINTERPOLATION_DEGREE = 5\n";
    const Aem aems[]{
        {.keys = "ATTITUDE_DIR = A2B\nQUATERNION_TYPE = FIRST\n" + lagrange, .row = first},
        {.keys = "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = FIRST\n" + lagrange,
         .row = [&](const Quat& q) { return first(conjugate(q)); }},
        {.a = "SC_BODY_1",
         .b = "ICRF",
         .keys = "ATTITUDE_DIR = B2A\nQUATERNION_TYPE = FIRST\n" + lagrange,
         .row = first},
        {.version = "2.0", .keys = lagrange},
    };
    for (const Aem& aem : aems) {
        const auto rows = read(Oem{}, aem);
        ASSERT_TRUE(rows) << rows.error().text();
        expect_motion(*rows, 1e-5, 1e-6, 1e-7, 1e-8);
    }
}

TEST_F(TrajectoryFiles, HermiteTakesTheDerivativesOfQuaternions) {
    Aem aem{.keys =
                "ATTITUDE_DIR = A2B\nATTITUDE_TYPE = QUATERNION/DERIVATIVE\nQUATERNION_TYPE = LAST\n"
                "INTERPOLATION_METHOD = HERMITE\nINTERPOLATION_DEGREE = 3\n"};
    aem.row = [](const Quat& q) {
        const Quat d = q * Quat{0, kAxis.x, kAxis.y, kAxis.z};
        const double k = 0.5 * kTurn_rad_s;
        return fmt::format("{:.15f} {:.15f} {:.15f} {:.15f} {:.15f} {:.15f} {:.15f} {:.15f}", q.x, q.y, q.z, q.w,
                           k * d.x, k * d.y, k * d.z, k * d.w);
    };
    const auto rows = read(Oem{}, aem);
    ASSERT_TRUE(rows) << rows.error().text();
    expect_motion(*rows, 1e-5, 1e-6, 1e-7, 1e-7);
}

TEST_F(TrajectoryFiles, TimeSystemsAreOneTime) {
    // 2026: TAI = UTC + 37 s, TT = TAI + 32.184 s, GPS = TAI - 19 s. TDB - TT is 1.4 ms at most.
    for (const auto& [system, ahead_s] : {std::pair{"TAI", 37.0}, {"TT", 69.184}, {"GPS", 18.0}}) {
        const auto rows = read(Oem{.system = system, .time = [a = ahead_s](double t) { return utc(t + a); }});
        ASSERT_TRUE(rows) << rows.error().text();
        expect_motion(*rows, 1e-4, 1e-4, 1e-7, 1e-8);
    }
    const auto rows = read(Oem{.system = "TDB", .time = [](double t) { return utc(t + 69.184); }});
    ASSERT_TRUE(rows) << rows.error().text();
    expect_motion(*rows, 7700 * 1.7e-3, 1, 1e-7, 1e-8);
}

TEST(TimeSystems, KnowLeapSecondsAndDaysOfYears) {
    const auto ns = [](std::string_view text, TimeSystem system = TimeSystem::utc) {
        const auto t = tai_ns(text, system);
        EXPECT_TRUE(t) << text;
        return t ? *t : 0;
    };
    EXPECT_EQ(ns("2000-01-01T00:00:00", TimeSystem::tai), 0);
    EXPECT_EQ(ns("2016-12-31T23:59:60.25"), ns("2017-01-01T00:00:00") - 750'000'000);
    EXPECT_EQ(ns("2017-01-01T00:00:00") - ns("2016-12-31T23:59:59"), 2'000'000'000);
    EXPECT_EQ(ns("2024-366T01:02:03.000000001Z"), ns("2024-12-31T01:02:03.000000001"));
    EXPECT_EQ(tai_ns_of_utc(1'772'366'400'000'000'000), ns("2026-03-01T12:00:00"));
    // 2 ms of TDB: USNO's series, 1.657 ms sin(g) + 0.022 ms sin(..), g = 357.53 deg + 0.98560028 deg/day.
    const double g = (357.53 + 0.98560028 * 9190) * std::numbers::pi / 180;
    EXPECT_NEAR(1e-6 * static_cast<double>(ns("2025-03-01T00:00:00", TimeSystem::tt) -
                                           ns("2025-03-01T00:00:00", TimeSystem::tdb)),
                1.657 * std::sin(g), 0.04);
    for (const char* bad :
         {"2026-02-30T00:00:00", "2025-366T00:00:00", "2026-03-01 00:00:00", "2026-03-01T24:00:00",
          "2026-03-01T23:59:60", "2026-03-01T00:00:00.", "2026-03-01T00:00:00+01:00", "1960-01-01T00:00:00", ""})
        EXPECT_FALSE(tai_ns(bad, TimeSystem::utc)) << bad;
}

TEST_F(TrajectoryFiles, TheWorldLiesWhereTheDescriptionSays) {
    // Mean equator of J2000 and ICRF differ by 23 mas, 0.8 m here. Frame bias: IERS Conventions 2010, 5.4.4
    // and 5.2.1.
    const auto rows = read(Oem{.frame = "EME2000"});
    ASSERT_TRUE(rows) << rows.error().text();
    const double mas = std::numbers::pi / 180 / 3600e3;
    const Vec3 p = orbit_m(0), bias{-14.6 * mas, -16.617 * mas, -6.8192 * mas};  // d alpha, xi, eta
    const Vec3 expected{p.x - bias.x * p.y + bias.y * p.z, p.y + bias.x * p.x + bias.z * p.z,
                        p.z - bias.y * p.x - bias.z * p.y};
    EXPECT_LT(norm(rows->front().motion.T_world_body.t - expected), 1e-3);
    EXPECT_GT(norm(rows->front().motion.T_world_body.t - p), 0.5);

    const Quat q = normalized(Quat{0.9, 0.3, -0.2, 0.1});
    const auto turned =
        read(Oem{}, {}, fmt::format("[world]\nattitude_wxyz = [{}, {}, {}, {}]\n", q.w, q.x, q.y, q.z));
    ASSERT_TRUE(turned) << turned.error().text();
    expect_motion(*turned, 1e-5, 1e-6, 1e-7, 1e-8, conjugate(q));
}

TEST_F(TrajectoryFiles, ABodyMayBeTheOriginOfLvlhAxes) {
    folder_.write("target.oem", Oem{}.text());
    folder_.write("chaser.oem", Oem{.offset_m = {30, 0, 0}}.text());
    const auto rows = read(head("until_s = 15\n") + R"(
[world]
origin = "target.oem"
axes = "LVLH"
[[body]]
name = "target"
oem = "target.oem"
attitude_wxyz = [1, 0, 0, 0]
[[body]]
name = "chaser"
oem = "chaser.oem"
attitude_wxyz = [0, 0, 0, 1]
[[body]]
name = "earth"
at_centre = true
attitude_wxyz = [1, 0, 0, 0]
)");
    ASSERT_TRUE(rows) << rows.error().text();
    ASSERT_EQ(rows->size(), 9u);
    EXPECT_EQ((*rows)[3].motion.T_world_body.t, Vec3{});
    EXPECT_LT(norm((*rows)[1].motion.T_world_body.t - Vec3{0, 0, 30}), 1e-5);  // up is along ICRF's x at time 0
    EXPECT_EQ((*rows)[1].motion.T_world_body.q, (Quat{0, 0, 0, 1}));
    EXPECT_LT(norm((*rows)[2].motion.T_world_body.t - Vec3{0, 0, -kRadius_m}), 1e-5);
    EXPECT_LT(norm((*rows)[2].motion.velocity_m_s - Vec3{-kRate_rad_s * kRadius_m, 0, 0}), 1e-5);
}

TEST_F(TrajectoryFiles, SegmentsFollowOneAnother) {
    Oem oem;
    const std::string text = oem.text();
    const std::size_t meta = text.find("META_START");
    std::string second = text.substr(meta);
    std::string first = text.substr(0, meta) + second;
    first.replace(first.find("STOP_TIME = " + utc(600)), 12 + utc(600).size(), "STOP_TIME = " + utc(300));
    second.replace(second.find("START_TIME = " + utc(0)), 13 + utc(0).size(), "START_TIME = " + utc(300));
    folder_.write("a.aem", Aem{}.text());
    const std::string description = head() + "[[body]]\nname = \"station\"\noem = \"a.oem\"\naem = \"a.aem\"\n";
    folder_.write("a.oem", first + "COVARIANCE_START\nEPOCH = " + utc(0) + "\n1.0\nCOVARIANCE_STOP\n" + second);
    const auto rows = read(description);
    ASSERT_TRUE(rows) << rows.error().text();
    expect_motion(*rows, 1e-5, 1e-6, 1e-7, 1e-8);
    second.replace(second.find(utc(300)), utc(300).size(), utc(340));
    folder_.write("a.oem", first + second);
    expect_error(read(description), "a.oem", "", "no data at 307.5 s");
}

TEST_F(TrajectoryFiles, TablesAreReadByTheNamesOfTheirColumns) {
    std::string table = "# made by a test\nnote;ET;Z;Y;X;VX;VY;VZ;qx;qy;qz;qw\n";
    for (int k = 0; k <= 600; k += 5) {
        const Vec3 p = 1e-3 * orbit_m(k), v = 1e-3 * orbit_m_s(k);
        const Quat q = conjugate(turning(k));
        table +=
            fmt::format("a;{};{:.12f};{:.12f};{:.12f};{:.12f};{:.12f};{:.12f};{:.15f};{:.15f};{:.15f};{:.15f}\n",
                        k / 60.0, p.z, p.y, p.x, v.x, v.y, v.z, q.x, q.y, q.z, q.w);
    }
    folder_.write("s.csv", table);
    const std::string description = head() + R"(
[[body]]
name = "station"
interpolation = "HERMITE"
degree = 7
attitude_interpolation = "LAGRANGE"
attitude_degree = 5
[body.table]
file = "s.csv"
frame = "world"
time = { column = "ET", unit = "min" }
position = { columns = ["X", "Y", "Z"], unit = "km" }
velocity = { columns = ["VX", "VY", "VZ"], unit = "km/s" }
attitude = { columns = ["qw", "qx", "qy", "qz"], order = "wxyz", turns = "frame_to_body" }
)";
    const auto rows = read(description);
    ASSERT_TRUE(rows) << rows.error().text();
    expect_motion(*rows, 1e-4, 1e-4, 1e-7, 1e-8);
    const auto with = [&](std::string what, const std::string& other) {
        std::string text = description;
        text.replace(text.find(what), what.size(), other);
        return read(text);
    };
    expect_error(with("\"VY\"", "\"V\""), "s.csv", "note;ET", "no column \"V\", expected it among note, ET");
    expect_error(with("\"X\", \"Y\"", "\"X\""), "t.toml", "position", "expected 3 names");
    expect_error(with(", unit = \"km\"", ""), "t.toml", "position", "has no \"unit\"");
    expect_error(with("order = \"wxyz\", ", ""), "t.toml", "attitude", "has no \"order\"");
    expect_error(with("unit = \"min\"", "unit = \"min\", system = \"UTC\""), "t.toml", "time",
                 "expected either `unit`");
    expect_error(with("unit = \"min\"", "system = \"UTC\""), "s.csv", "a;0;", "expected a time of the years");
    expect_error(with("velocity = ", "# "), "t.toml", "interpolation", "HERMITE without velocities");
    folder_.write("s.csv", table + "a;9.9;1;1;1;1;1;1;0;0;0;1\n");
    expect_error(read(description), "s.csv", "a;9.9", "does not come after that of line");
    folder_.write("s.csv", table + "a;10.1;1;1;1;1;1;1;0;0;0;1.1\n");
    expect_error(read(description), "s.csv", "a;10.1", "quaternion of norm 1.1");
    folder_.write("s.csv", table + "a;10.1;1;1\n");
    expect_error(read(description), "s.csv", "a;10.1", "4 columns, expected 12");
}

TEST_F(TrajectoryFiles, WhatIsWrongIsNamedWithItsLine) {
    const auto oem = [](const std::string& what, const std::string& other) {
        return [=, text = Oem{}.text()]() mutable { return text.replace(text.find(what), what.size(), other); }();
    };
    const auto of = [&](const std::string& file, const std::string& text) {
        folder_.write("a.oem", file == "a.oem" ? text : Oem{}.text());
        folder_.write("a.aem", file == "a.aem" ? text : Aem{}.text());
        return read(head() + "[[body]]\nname = \"station\"\noem = \"a.oem\"\naem = \"a.aem\"\n");
    };
    const auto expect_oem = [&](const std::string& text, const std::string& line, const std::string& what) {
        expect_error(of("a.oem", text), "a.oem", line, what);
    };
    expect_oem(oem("VERS = 2.0", "VERS = 9.0"), "VERS", "expected one of 1.0, 2.0, 3.0");
    expect_oem("<?xml version=\"1.0\"?>\n<oem/>\n", "<?xml", "XML is not read");
    expect_oem(oem("REF_FRAME = ICRF", "REF_FRAME = TEME"), "TEME", "expected one of ICRF, GCRF, EME2000, J2000");
    expect_oem(oem("TIME_SYSTEM = UTC", "TIME_SYSTEM = UT1"), "UT1", "expected one of UTC, TAI, TT, TDB, GPS");
    expect_oem(oem("OBJECT_ID", "OBJEKT_ID"), "OBJEKT_ID", "unknown keyword OBJEKT_ID");
    expect_oem(oem("CENTER_NAME = EARTH\n", ""), "META_START", "no CENTER_NAME");
    expect_oem(oem("META_STOP\n", ""), "2026-03-01T12:00:00.0", "expected KEYWORD = VALUE");
    expect_oem(oem("INTERPOLATION = HERMITE", "INTERPOLATION = PROPAGATE"), "PROPAGATE", "expected one of LINEAR");
    expect_oem(oem("DEGREE = 7", "DEGREE = 6"), "DEGREE", "expected an odd degree");
    expect_oem(oem("INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 7\n", ""), "META_START",
               "has no INTERPOLATION");
    expect_oem(oem("DEGREE = 7", "DEGREE = 31") + "META_START\n", "META_START", "ends here, expected META_STOP");
    expect_oem(oem(utc(40), utc(20)), utc(20), "does not come after that of line");
    expect_oem(oem(utc(40) + " ", utc(40) + " nan "), utc(40), "7 numbers behind the time");
    expect_oem(oem(utc(40) + " 6", utc(40) + " x6"), utc(40), "where a finite number was expected");

    const auto expect_aem = [&](const std::string& what, const std::string& other, const std::string& line,
                                const std::string& error) {
        std::string text = Aem{}.text();
        text.replace(text.find(what), what.size(), other);
        expect_error(of("a.aem", text), "a.aem", line, error);
    };
    expect_aem("= QUATERNION\n", "= EULER_ANGLE\n", "EULER_ANGLE", "expected one of QUATERNION");
    expect_aem("QUATERNION_TYPE = LAST\n", "", "META_START", "has no QUATERNION_TYPE");
    expect_aem("REF_FRAME_B = SC_BODY_1", "REF_FRAME_B = ICRF", "REF_FRAME_B",
               "expected one of them to be SC_BODY");
    expect_aem("= LAGRANGE", "= HERMITE", "META_START", "HERMITE of quaternions without derivatives");
    expect_aem("DATA_STOP\n", "", "", "ends here, expected DATA_STOP");
    expect_error(read_trajectory(folder_ / "a.oem"), "a.oem", "CCSDS",
                 "expected a CSV, or a trajectory description");
}

TEST_F(TrajectoryFiles, DescriptionsStateEachBodyOnce) {
    folder_.write("a.oem", Oem{.interpolation = ""}.text());
    folder_.write("b.oem", Oem{.time = [](double t) { return utc(t + 900); }}.text());
    const std::string body = "[[body]]\nname = \"a\"\nattitude_wxyz = [1, 0, 0, 0]\n";
    EXPECT_TRUE(read(head() + body + "oem = \"a.oem\"\ninterpolation = \"HERMITE\"\ndegree = 7\n"));
    expect_error(read(head() + body), "t.toml", "name", "expected one position: `oem`");
    expect_error(read(head() + body + "oem = \"a.oem\"\nposition_m = [0, 0, 0]\n"), "t.toml", "name",
                 "expected one position");
    expect_error(read(head() + body + "oem = \"a.oem\"\ninterpolation = \"HERMITE\"\n"), "t.toml", "interpolation",
                 "expected `degree`, too");
    expect_error(read(head() + body + "position_m = [0, 0, 0]\n"), "t.toml", "", "no body moves");
    expect_error(read(head() + body + "position_m = [0, 0, 0]\n" + body + "position_m = [0, 0, 0]\n"), "t.toml",
                 "name", "a second time");
    expect_error(read(head() + "[world]\naxes = \"LVLH\"\n" + body + "at_centre = true\n"), "t.toml", "LVLH",
                 "expected an OEM");
    expect_error(
        read(head() + "[world]\norigin = \"a.oem\"\ninterpolation = \"LINEAR\"\n" + body + "oem = \"b.oem\"\n"),
        "t.toml", "", "b.oem begins at 900 s");
    expect_error(read(head("until_s = 700\n") + body + "oem = \"a.oem\"\ninterpolation = \"LINEAR\"\n"), "t.toml",
                 "", "outside of the files' time");
    expect_error(read(head() + body + "oem = \"missing.oem\"\n"), "missing.oem", "", "cannot be opened");
    EXPECT_TRUE(read(body + "oem = \"a.oem\"\ninterpolation = \"LINEAR\"\n" + head()));
    expect_error(read(head("step_ms = 3\n") + body + "at_centre = true\n"), "t.toml", "step_ms", "unknown key");
}

}  // namespace
}  // namespace narpa
