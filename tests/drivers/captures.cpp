// Captures that are generated, and those that go wrong. An independent reader, tshark, and the Python package read
// the same files.
#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>
#include <set>

#include "drivers/lidar/capture.h"
#include "tests/drivers/generated_capture.h"
#include "tests/support/campaign.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::GeneratedCapture;

void write(const std::string& path, const std::vector<std::uint8_t>& bytes, bool gzip) {
    if (!gzip) {
        std::ofstream(path, std::ios::binary)
            .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
        return;
    }
    gzFile file = ::gzopen(path.c_str(), "wb1");
    ASSERT_NE(file, nullptr);
    EXPECT_EQ(::gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size())), static_cast<int>(bytes.size()));
    EXPECT_EQ(::gzclose(file), Z_OK);
}

std::string text_of(const CaptureCounters& c) {
    std::string text = "frames";
    for (const auto n : {c.frames, c.other, c.cut, c.malformed, c.repeated, c.incomplete})
        text += " " + std::to_string(n);
    return text;
}

/// Time, source, port, size and checksum of each datagram, after the counters.
std::string text_of(const std::vector<UdpDatagram>& datagrams, const CaptureCounters& counters, bool cut) {
    std::string text = text_of(counters) + (cut ? " cut\n" : "\n");
    for (const UdpDatagram& d : datagrams)
        text += std::to_string(d.t_ns) + " " + d.source + " " + std::to_string(d.port) + " " +
                std::to_string(d.payload.size()) + " " +
                std::to_string(::crc32(0, d.payload.data(), static_cast<unsigned>(d.payload.size()))) + "\n";
    return text;
}

class Captures : public testing::Test {
protected:
    void SetUp() override {
        const auto probe = read_capture("none.pcap");
        if (probe.error().text().find("built without captures") != std::string::npos)
            GTEST_SKIP() << "built without libpcap";
    }
    std::string why_not(const std::vector<std::uint8_t>& bytes) {
        write(folder_ / "bad.pcap", bytes, false);
        const auto capture = read_capture(folder_ / "bad.pcap");
        return capture ? "" : capture.error().what;
    }
    test::TemporaryFolder folder_;
};

/// The trials' captures, in files of a folder named after their seeds.
class GeneratedCaptures : public Captures {
protected:
    static std::string expected(const GeneratedCapture& c) { return text_of(c.datagrams, c.counters, c.is_cut); }
    std::string path(int seed) const { return folder_ / (std::to_string(seed) + ".pcap"); }
};

TEST_F(GeneratedCaptures, GiveTheirDatagramsOnceAndCountTheRest) {
    const int trials = test::trials(200, 10'000);
    for (int seed = 0; seed < trials; ++seed) {
        const GeneratedCapture c = test::generated_capture(static_cast<unsigned>(seed));
        write(path(0), c.file, c.gzip);
        const auto read = read_capture(path(0));
        ASSERT_TRUE(read) << "seed " << seed << ": " << read.error().text();
        ASSERT_EQ(text_of(read->datagrams, read->counters, !read->cut.empty()), expected(c))
            << "seed " << seed << " " << read->cut;
    }
}

TEST_F(GeneratedCaptures, AreReadAlikeByThePythonPackage) {
    if (test::run_command("/usr/bin/python3 -c 'import ipaddress' 2>&1").status != 0) GTEST_SKIP() << "no python3";
    const int trials = test::trials(200, 10'000), batch = 200;
    for (int begin = 0; begin < trials; begin += batch) {
        std::string expected_text;
        for (int seed = begin; seed < begin + batch; ++seed) {
            const GeneratedCapture c = test::generated_capture(static_cast<unsigned>(seed));
            write(path(seed), c.file, c.gzip);
            expected_text += std::to_string(seed) + " " + expected(c);
        }
        std::ofstream(folder_ / "read.py")
            << "import sys, zlib\n"
               "from narpa import pcap\n"
               "for seed in range(int(sys.argv[1]), int(sys.argv[2])):\n"
               "    c = pcap.read(f'{sys.argv[3]}/{seed}.pcap')\n"
               "    print(seed, 'frames', *c.counts.values(), *['cut'] * bool(c.cut))\n"
               "    for d in c.datagrams:\n"
               "        print(*d[:3], len(d.payload), zlib.crc32(d.payload))\n";
        const test::Done done = test::run_command(
            "PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" + test::source_path("python") + " " + test::kTimeLimit +
            "/usr/bin/python3 " + (folder_ / "read.py") + " " + std::to_string(begin) + " " +
            std::to_string(begin + batch) + " " + (folder_ / "") + " 2>&1");
        ASSERT_EQ(done.status, 0) << done.out;
        ASSERT_EQ(done.out, expected_text) << "seeds from " << begin;
        for (int seed = begin; seed < begin + batch; ++seed) std::remove(path(seed).c_str());
    }
}

/// Size and checksum.
std::string text_of(const std::vector<std::uint8_t>& payload) {
    return std::to_string(payload.size()) + ":" +
           std::to_string(::crc32(0, payload.data(), static_cast<unsigned>(payload.size())));
}

std::vector<std::uint8_t> bytes_of(std::string_view hex) {
    std::vector<std::uint8_t> out;
    for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
        out.push_back(static_cast<std::uint8_t>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
    return out;
}

TEST_F(GeneratedCaptures, AreReadAlikeByTshark) {
    if (test::run_command("tshark --version 2>&1").status != 0) GTEST_SKIP() << "no tshark on this machine";
    const int trials = test::trials(12, 400);
    int compared = 0;
    for (int seed = 0; seed < trials; ++seed) {
        const GeneratedCapture c = test::generated_capture(static_cast<unsigned>(seed));
        if (!c.is_plain) continue;
        write(path(0), c.file, c.gzip);
        const test::Done done = test::run_command(test::kTimeLimit + ("tshark -n -r " + path(0)) +
                                                  " -Y udp -T fields -e udp.payload 2>/dev/null");
        ASSERT_EQ(done.status, 0);
        std::set<std::string> found;
        for (std::size_t at = 0, end; (end = done.out.find('\n', at)) != std::string::npos; at = end + 1)
            if (end > at) found.insert(text_of(bytes_of(std::string_view(done.out).substr(at, end - at))));
        std::set<std::string> expected_payloads;
        for (const UdpDatagram& d : c.datagrams) expected_payloads.insert(text_of(d.payload));
        ASSERT_EQ(found, expected_payloads) << "seed " << seed;
        ++compared;
    }
    EXPECT_GT(compared, 2);
}

TEST_F(Captures, WhatIsWholeOfACutGzipStreamIsUsed) {
    unsigned seed = 0;
    while (test::generated_capture(seed).datagrams.size() < 8 || test::generated_capture(seed).is_cut) ++seed;
    const GeneratedCapture c = test::generated_capture(seed);
    write(folder_ / "c.pcap", c.file, true);
    std::vector<std::uint8_t> bytes = test::read_bytes(folder_ / "c.pcap");
    bytes.resize(bytes.size() * 3 / 4);
    write(folder_ / "c.pcap", bytes, false);
    const auto read = read_capture(folder_ / "c.pcap");
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_FALSE(read->cut.empty());
    EXPECT_GT(read->datagrams.size(), 0u);
    EXPECT_LT(read->datagrams.size(), c.datagrams.size());
}

TEST_F(Captures, ErrorsSayWhatTheFileIs) {
    EXPECT_EQ(read_capture("none.pcap").error().text(),
              "none.pcap: No such file or directory; expected a capture (pcap)");
    EXPECT_NE(why_not({0x28, 0xB5, 0x2F, 0xFD, 0, 0}).find("compressed by zstd, expected"), std::string::npos);
    EXPECT_NE(why_not({'n', 'o', 't', ' ', 'o', 'n', 'e'}).find("expected a capture (pcap)"), std::string::npos);
    EXPECT_NE(why_not({}).find("expected a capture (pcap)"), std::string::npos);
    std::vector<std::uint8_t> wireless = {0xD4, 0xC3, 0xB2, 0xA1, 2, 0, 4, 0, 0,   0, 0, 0,
                                          0,    0,    0,    0,    0, 0, 1, 0, 105, 0, 0, 0};
    EXPECT_EQ(
        why_not(wireless),
        "link type IEEE802_11, expected Ethernet, Linux cooked (SLL, SLL2), raw IP or BSD loopback (NULL, LOOP)");
}

/// A fragment of an IPv4 packet, as a raw IP frame.
std::vector<std::uint8_t> fragment(std::uint8_t id, std::size_t offset, bool more,
                                   const std::vector<std::uint8_t>& body) {
    const std::size_t flags = offset / 8 | (more ? 0x2000u : 0u), total = 20 + body.size();
    std::vector<std::uint8_t> out{0x45,
                                  0,
                                  static_cast<std::uint8_t>(total >> 8),
                                  static_cast<std::uint8_t>(total),
                                  0,
                                  id,
                                  static_cast<std::uint8_t>(flags >> 8),
                                  static_cast<std::uint8_t>(flags),
                                  64,
                                  17,
                                  0,
                                  0,
                                  10,
                                  0,
                                  0,
                                  1,
                                  10,
                                  0,
                                  0,
                                  2};
    out.insert(out.end(), body.begin(), body.end());
    return out;
}

std::vector<std::uint8_t> udp_of(std::uint8_t value) {
    std::vector<std::uint8_t> out(24, value);
    const std::vector<std::uint8_t> header{9, 64, 9, 64, 0, 24, 0, 0};
    std::ranges::copy(header, out.begin());
    return out;
}

TEST(Datagrams, OfOneIdentificationAreToldApart) {
    constexpr std::int64_t kLater_ns = 5'000'000'000;
    DatagramReader reader(101);
    const auto take = [&](std::int64_t t_ns, std::size_t offset, std::uint8_t value, std::size_t size) {
        const auto udp = udp_of(value);
        const std::vector<std::uint8_t> body(udp.begin() + static_cast<std::ptrdiff_t>(offset),
                                             udp.begin() + static_cast<std::ptrdiff_t>(offset + size));
        const auto frame = fragment(1, offset, offset + size < udp.size(), body);
        reader.take(t_ns, frame, frame.size());
    };
    take(0, 0, 1, 16), take(1, 16, 1, 8);                              // whole
    take(2, 0, 2, 16), take(3, 8, 2, 16);                              // the same number again; its parts overlap
    take(4, 0, 3, 16), take(5, 0, 4, 16), take(6, 16, 4, 8);           // the end of the third is missing
    take(7, 0, 5, 16), take(kLater_ns, 16, 5, 8);                      // too late to be of one packet
    take(2 * kLater_ns, 0, 6, 16), take(2 * kLater_ns + 1, 0, 6, 24);  // as a whole, after its first part
    const auto datagrams = reader.finish();
    std::vector<int> values;
    for (const UdpDatagram& d : datagrams) values.push_back(d.payload.at(0));
    EXPECT_EQ(values, (std::vector{1, 2, 4, 6}));
    EXPECT_EQ(reader.counters().incomplete, 3u + 1u)
        << "the third, both parts of the fifth, the first part of the sixth";
}

TEST(Datagrams, TheSamePayloadIsARepeatOnlySoonAndFromTheSameAddress) {
    DatagramReader reader(101);
    auto frame = fragment(0, 0, false, udp_of(7));
    const std::int64_t minute_ns = 60'000'000'000;
    reader.take(0, frame, frame.size());
    reader.take(minute_ns, frame, frame.size());
    reader.take(2 * minute_ns + 1, frame, frame.size());
    frame[15] = 9;  // another source
    reader.take(1, frame, frame.size());
    EXPECT_EQ(reader.finish().size(), 3u);
    EXPECT_EQ(reader.counters().repeated, 1u);
}

}  // namespace
}  // namespace narpa
