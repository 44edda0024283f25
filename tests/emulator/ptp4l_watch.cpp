// What reports say of ptp4l, without a run.
#include "emulator/ptp4l_watch.h"

#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using Reached = Ptp4lReading::Result;

Ptp4lReport answered_report() {
    Ptp4lReport report;
    report.socket = "/run/ptp4l";
    report.readings = report.answered = report.slave = 3;
    report.slave_offset_ns_max = 2500;
    report.last = {.result = Reached::answered,
                   .status = {.state = PtpPortState::slave,
                              .ports = 1,
                              .steps_removed = 1,
                              .offset_ns = -1500,
                              .mean_path_delay_ns = 250'000,
                              .grandmaster_present = true,
                              .grandmaster = {0x52, 0x54, 0, 0xFF, 0xFE, 0x12, 0x34, 0x56},
                              .tai_less_utc_s = 37}};
    return report;
}

TEST(Ptp4lReport, HasTheStateInSecondsAndWords) {
    const auto document = to_json(answered_report());
    EXPECT_EQ(document["state"], "SLAVE");
    EXPECT_DOUBLE_EQ(document["offset_s"], -1.5e-6);
    EXPECT_DOUBLE_EQ(document["offset_s_max"], 2.5e-6);
    EXPECT_DOUBLE_EQ(document["mean_path_delay_s"], 250e-6);
    EXPECT_EQ(document["grandmaster"], "525400.fffe.123456");
    EXPECT_EQ(document["tai_less_utc_valid"], false);
    EXPECT_EQ(to_text(answered_report()),
              "SLAVE, offset from the master -1.500 us (at most 2.500 us), path delay 250.000 us, grandmaster "
              "525400.fffe.123456; time scale arbitrary, TAI less UTC 37 s (not valid)");
}

TEST(Ptp4lReport, AMasterHasNoOffset) {
    Ptp4lReport report = answered_report();
    report.slave = 0;
    report.last.status.state = PtpPortState::master;
    report.last.status.grandmaster_present = false;
    EXPECT_TRUE(to_json(report)["offset_s_max"].is_null());
    EXPECT_EQ(
        to_text(report),
        "MASTER, grandmaster 525400.fffe.123456 (this clock); time scale arbitrary, TAI less UTC 37 s (not valid)");
}

TEST(Ptp4lReport, SaysWhyThereIsNoState) {
    Ptp4lReport report = answered_report();
    for (const auto& [result, words] : {std::pair{Reached::no_socket, "none runs: nothing listens at /run/ptp4l"},
                                        std::pair{Reached::not_permitted, "this user may not use /run/ptp4l"},
                                        std::pair{Reached::no_answer, "no answer at /run/ptp4l"}}) {
        report.last = {.result = result};
        const auto document = to_json(report);
        EXPECT_TRUE(document["state"].is_null());
        EXPECT_NE(std::string(document["reason"]).find(words), std::string::npos);
        EXPECT_FALSE(document.contains("offset_s"));
        EXPECT_NE(to_text(report).find(words), std::string::npos);
    }
}

TEST(Ptp4lWatch, ReadsOnItsOwnAndEndsAtOnce) {
    const test::TemporaryFolder folder;
    Ptp4lWatch watch(folder / "none", 0);
    while (watch.report().readings == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_EQ(watch.report().last.result, Reached::no_socket);
    EXPECT_EQ(watch.report().socket, folder / "none");
    EXPECT_EQ(read_ptp4l(folder / "none", 0).readings, 1u);
}

}  // namespace
}  // namespace narpa
