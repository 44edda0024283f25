// What `narpa estimate --sweep` makes of captures that are not as one LiDAR sent them.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "protocols/little_endian.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa::test {
namespace {

using nlohmann::json;
using Record = std::vector<std::uint8_t>;  ///< with its header, in a nanosecond capture

constexpr std::size_t kFileHeader = 24, kRecordHeader = 16, kSourceAt = kRecordHeader + 14 + 12,
                      kPayloadAt = kRecordHeader + 42, kDataRecord = kPayloadAt + 1206;

/// A scene of a box before a VLP-16, and the capture of its scan.
class SweepFiles : public testing::Test {
protected:
    void SetUp() override {
        std::ofstream(folder_ / "box.obj") << "v -0.5 -0.4 -0.6\nv 0.5 -0.4 -0.6\nv 0.5 0.4 -0.6\nv -0.5 0.4 -0.6\n"
                                              "v -0.5 -0.4 0.6\nv 0.5 -0.4 0.6\nv 0.5 0.4 0.6\nv -0.5 0.4 0.6\n"
                                              "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
        write_scene("VLP-16", "");
        const Done scanned = narpa("scan " + scene_ + " -o " + (folder_ / "scan.pcap"));
        if (scanned.out.find("built without captures") != std::string::npos)
            GTEST_SKIP() << "built without libpcap";
        ASSERT_EQ(scanned.status, 0) << scanned.out;
        const std::vector<std::uint8_t> file = read_bytes(folder_ / "scan.pcap");
        header_.assign(file.begin(), file.begin() + kFileHeader);
        for (std::size_t at = kFileHeader; at < file.size();) {
            const std::size_t size = kRecordHeader + get_le<std::uint32_t>(&file[at + 8]);
            Record record(&file[at], &file[at] + size);
            if (size == kDataRecord) records_.push_back(record);
            at += size;
        }
        ASSERT_EQ(records_.size(), 76u);
    }
    void write_scene(const std::string& model, const std::string& more) {
        std::ofstream(scene_) << "[scene]\nepoch = 2026-01-01T00:00:00Z\n[sun]\ndirection = [0, 0, 1]\n"
                                 "[[body]]\nname = \"box\"\nmesh = \"box.obj\"\nposition_m = [0.5, 5, 0.2]\n"
                                 "attitude_wxyz = [0.953583, 0.100377, 0.200754, 0.200754]\n"
                                 "[[lidar]]\nname = \"top\"\nmodel = \""
                              << model << "\"\n"
                              << more;
    }
    static Done narpa(const std::string& arguments) { return run_command(NARPA_BIN " " + arguments + " 2>&1"); }

    Done estimate(const std::vector<Record>& records, const std::string& options = "") {
        std::ofstream out(folder_ / "c.pcap", std::ios::binary);
        const auto put = [&](const Record& r) {
            out.write(reinterpret_cast<const char*>(r.data()), static_cast<std::streamsize>(r.size()));
        };
        put(header_);
        for (const Record& r : records) put(r);
        out.close();
        return narpa("estimate " + scene_ + " --sweep " + (folder_ / "c.pcap") + " --start 2,2 --json " + options);
    }
    json estimated(const std::vector<Record>& records, const std::string& options = "") {
        const Done done = estimate(records, options);
        EXPECT_EQ(done.status, 0) << done.out;
        const std::size_t at = done.out.find("\n{");
        return at == std::string::npos ? json() : json::parse(done.out.substr(at + 1));
    }
    static Record from(Record record, std::uint8_t unit) {
        record[kSourceAt + 3] = unit;
        return record;
    }

    TemporaryFolder folder_;
    std::string scene_ = folder_ / "s.toml";
    Record header_;
    std::vector<Record> records_;
};

TEST_F(SweepFiles, NeitherOrderNorRepeatsChangeWhatIsMeasured) {
    const json plain = estimated(records_);
    EXPECT_GT(plain["points"], 100);
    EXPECT_EQ(plain["capture"]["used"], 76);
    std::vector<Record> strange(records_.rbegin(), records_.rend());
    strange.insert(strange.end(), records_.begin(), records_.begin() + 10);
    // The network exchanged two packets: they were captured in that order.
    std::swap_ranges(strange[0].begin(), strange[0].begin() + 8, strange[1].begin());
    const json found = estimated(strange);
    EXPECT_EQ(found["capture"]["used"], 76);
    EXPECT_EQ(found["capture"]["repeated"], 10);
    EXPECT_EQ(found["points"], plain["points"]);
    EXPECT_EQ(found["covariance"], plain["covariance"]);
    EXPECT_EQ(found["pose"], plain["pose"]);
}

TEST_F(SweepFiles, OfSeveralUnitsOneIsChosen) {
    std::vector<Record> both;
    for (const Record& r : records_) both.push_back(r), both.push_back(from(r, 202));
    const Done refused = estimate(both);
    EXPECT_EQ(refused.status, 2);
    EXPECT_NE(refused.out.find("data packets of 2 units: 192.168.1.201:2368, 192.168.1.202:2368; choose one with "
                               "--unit ADDRESS:PORT"),
              std::string::npos)
        << refused.out;
    for (const char* unit : {"192.168.1.202", "192.168.1.202:2368"}) {
        const json found = estimated(both, std::string("--unit ") + unit);
        EXPECT_EQ(found["capture"]["used"], 76);
        EXPECT_EQ(found["capture"]["other_unit"], (json{{"192.168.1.201:2368", 76}}));
    }
    const Done none = estimate(both, "--unit 192.168.1.20");
    EXPECT_EQ(none.status, 2);
    EXPECT_NE(
        none.out.find("no data packet of 192.168.1.20, expected at least one; datagrams: 76 from 192.168.1.201"),
        std::string::npos)
        << none.out;
}

TEST_F(SweepFiles, WhatIsLeftOutIsCountedAndNamed) {
    std::vector<Record> records = records_;
    records[3][kPayloadAt + 1205] = 0x21;  // an HDL-32E's
    records[4].resize(kDataRecord - 100);  // the snapshot length
    put_le(&records[4][8], static_cast<std::uint32_t>(kDataRecord - kRecordHeader - 100));
    records.back().resize(40);
    const Done done = estimate(records);
    ASSERT_EQ(done.status, 0) << done.out;
    for (const char* words : {"warning: ", "cut short, what is whole is used: truncated dump file",
                              "dropped: 1 frames captured in part only (snapshot length)",
                              "no data packets of this LiDAR: 1: product 21, expected 22"})
        EXPECT_NE(done.out.find(words), std::string::npos) << words << "\n" << done.out;
    const json capture = json::parse(done.out.substr(done.out.find("\n{") + 1))["capture"];
    const std::string document = read_text(source_path("protocols/lidar/README.md"));
    for (const auto& [key, value] : capture.items())
        EXPECT_NE(document.find("| `" + key + "` |"), std::string::npos)
            << key << " is not in the document's table";
    EXPECT_EQ(capture["used"], 73);
    EXPECT_EQ(capture["frames"], 75);
    EXPECT_EQ(capture["cut_frames"], 1);
    EXPECT_EQ(capture["refused"], (json{{"product 21, expected 22", 1}}));
}

TEST_F(SweepFiles, SizesAndIdentitiesThatDoNotFitAreNamed) {
    std::string zeros = "0";
    for (int i = 1; i < 16; ++i) zeros += ", 0";
    const auto write_metadata = [&](const char* init_id) {
        std::ofstream(folder_ / "m.json")
            << "{\"beam_altitude_angles\": [" << zeros << "], \"beam_azimuth_angles\": [" << zeros
            << "],\n\"initialization_id\": " << init_id << "}";
    };
    write_metadata("12345");
    write_scene("os1-16", "calibration = \"m.json\"\n");
    const Done size = estimate(records_);
    EXPECT_EQ(size.status, 2);
    EXPECT_NE(
        size.out.find("holds no UDP datagram of 3328 bytes, expected those of a os1-16; datagrams: 76 of 1206 "
                      "bytes to port 2368"),
        std::string::npos)
        << size.out;
    const std::string capture = folder_ / "os1.pcap";
    ASSERT_EQ(narpa("scan " + scene_ + " -o " + capture).status, 0);
    write_metadata("12346");
    const Done identity = narpa("estimate " + scene_ + " --sweep " + capture + " --start 2,2");
    EXPECT_EQ(identity.status, 2);
    EXPECT_NE(identity.out.find("64: init id 12345 in the packets, 12346 in the sensor's metadata"),
              std::string::npos)
        << identity.out;
}

TEST_F(SweepFiles, TimesThatACaptureCannotStateAreRefused) {
    const Done done = narpa("scan " + scene_ + " --time 3e9 -o " + (folder_ / "x.pcap"));
    EXPECT_EQ(done.status, 2);
    EXPECT_NE(done.out.find("the scan ends after 2105"), std::string::npos) << done.out;
}

/// The last packets of an hour, and the first of the next.
TEST_F(SweepFiles, ATurnMayCrossTheHour) {
    for (const bool counts_on : {false, true}) {
        std::vector<Record> records = records_;
        std::uint32_t past_us = 3'599'950'000;
        for (Record& r : records) {
            put_le(&r[kPayloadAt + 1200], counts_on ? past_us : past_us % 3'600'000'000u);
            past_us += 1327;
        }
        EXPECT_EQ(estimated(records)["capture"]["used"], 76) << counts_on;
    }
}

TEST_F(SweepFiles, EpochsThatNoPacketCanStateAreRefused) {
    std::string text = read_text(scene_);
    text.replace(text.find("2026-01-01T00:00:00Z"), 20, "1969-12-31T23:59:59Z");
    std::ofstream(scene_) << text;
    for (const std::string& command : {std::string("check "), "scan -o " + (folder_ / "x.pcap") + " "}) {
        const Done done = narpa(command + scene_);
        EXPECT_EQ(done.status, 2);
        EXPECT_NE(done.out.find("expected an epoch in [scene] of 1970 to 2105"), std::string::npos) << done.out;
    }
}

}  // namespace
}  // namespace narpa::test
