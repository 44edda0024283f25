#include <gtest/gtest.h>
#include <sys/resource.h>

#include "drivers/lidar/packet_sink.h"
#include "protocols/lidar/velodyne.h"
#include "protocols/little_endian.h"
#include "tests/drivers/video_support.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Bytes;

constexpr std::int64_t kEpoch = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z
constexpr std::size_t kFileHeader = 24, kRecordHeader = 16, kHeaders = 14 + 20 + 8;

struct Record {
    std::int64_t t_ns = 0;
    Bytes frame;
};

// Reads a capture by the layout of draft-ietf-opsawg-pcap: nanosecond magic, Ethernet.
std::vector<Record> records_of(const Bytes& file) {
    std::vector<Record> records;
    if (file.size() < kFileHeader || get_le<std::uint32_t>(file.data()) != 0xA1B23C4D ||
        get_le<std::uint32_t>(file.data() + 20) != 1) {
        ADD_FAILURE() << "no nanosecond Ethernet capture";
        return records;
    }
    for (std::size_t at = kFileHeader; at < file.size();) {
        const std::uint8_t* head = file.data() + at;
        const std::size_t left = file.size() - at;
        if (left < kRecordHeader || left < kRecordHeader + get_le<std::uint32_t>(head + 8)) {
            ADD_FAILURE() << "torn record " << records.size();
            return records;
        }
        const auto size = get_le<std::uint32_t>(head + 8);
        EXPECT_EQ(size, get_le<std::uint32_t>(head + 12));
        records.push_back(
            {std::int64_t{get_le<std::uint32_t>(head)} * 1'000'000'000 + get_le<std::uint32_t>(head + 4),
             Bytes(head + kRecordHeader, head + kRecordHeader + size)});
        at += kRecordHeader + size;
    }
    return records;
}

unsigned be16(const Bytes& b, std::size_t at) {
    return static_cast<unsigned>(b[at] << 8 | b[at + 1]);
}

// RFC 1071: over data with its checksum in place the sum is 0xFFFF.
unsigned ones_sum(const std::uint8_t* at, std::size_t size, unsigned sum = 0) {
    for (std::size_t i = 0; i < size; ++i) sum += static_cast<unsigned>(i % 2 == 0 ? at[i] << 8 : at[i]);
    while (sum >> 16) sum = (sum & 0xFFFF) + (sum >> 16);
    return sum;
}

Bytes payload(std::size_t size, std::uint64_t seed) {
    Bytes bytes(size);
    std::mt19937_64 random(seed);
    for (auto& b : bytes) b = static_cast<std::uint8_t>(random());
    return bytes;
}

class PcapSink : public testing::Test {
protected:
    void SetUp() override {
        const auto probe = open_packet_sink(folder_ / "probe.pcap", vlp16().network, true);
        if (!probe && probe.error().text().find("built without captures") != std::string::npos)
            GTEST_SKIP() << "built without libpcap";
    }
    std::unique_ptr<PacketSink> opened(bool wait) {
        auto sink = open_packet_sink(path_, vlp16().network, wait);
        EXPECT_TRUE(sink) << sink.error().text();
        return sink ? std::move(*sink) : nullptr;
    }

    test::TemporaryFolder folder_;
    std::string path_ = folder_ / "out.pcap";
};

TEST_F(PcapSink, HoldsThePacketsAsTheInstrumentBroadcastsThem) {
    constexpr int count = 200;
    {
        const auto sink = opened(true);
        for (int i = 0; i < count; ++i) {
            const bool data = i % 15 != 14;
            EXPECT_TRUE(sink->send(data ? PacketKind::data : PacketKind::position,
                                   payload(data ? 1206 : 512, static_cast<std::uint64_t>(i)),
                                   kEpoch + i * 1'327'104LL));
        }
    }
    const std::vector<Record> records = records_of(test::read_bytes(path_));
    ASSERT_EQ(records.size(), static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) {
        const auto& [t_ns, f] = records[static_cast<std::size_t>(i)];
        const bool data = i % 15 != 14;
        const std::size_t size = data ? 1206 : 512;
        ASSERT_EQ(f.size(), kHeaders + size);  // 1248 and 554, as the manual says
        EXPECT_EQ(t_ns, kEpoch + i * 1'327'104LL);
        EXPECT_EQ(be16(f, 12), 0x0800U);
        EXPECT_EQ(f[14], 0x45);
        EXPECT_EQ(be16(f, 16), 20 + 8 + size);
        EXPECT_EQ(f[23], 17);
        EXPECT_EQ((Bytes(f.begin() + 26, f.begin() + 34)), (Bytes{192, 168, 1, 201, 255, 255, 255, 255}));
        EXPECT_EQ(ones_sum(&f[14], 20), 0xFFFFU);
        EXPECT_EQ(be16(f, 34), data ? 2368U : 8308U);
        EXPECT_EQ(be16(f, 36), data ? 2368U : 8308U);
        EXPECT_EQ(be16(f, 38), 8 + size);
        // RFC 768: addresses, protocol and length are summed too.
        EXPECT_EQ(ones_sum(&f[34], 8 + size, ones_sum(&f[26], 8, static_cast<unsigned>(17 + 8 + size))), 0xFFFFU);
        EXPECT_TRUE(
            std::equal(f.begin() + kHeaders, f.end(), payload(size, static_cast<std::uint64_t>(i)).begin()));
    }
}

TEST_F(PcapSink, IsReadableWhileItIsWritten) {
    const auto sink = opened(true);
    sink->send(PacketKind::data, payload(1206, 1), 5);
    sink->flush();
    EXPECT_EQ(records_of(test::read_bytes(path_)).size(), 1U);
    EXPECT_EQ(sink->counters().sent, 1U);
}

// A limit on the file's size stands for a disk that fills up and is cleaned up again.
TEST_F(PcapSink, FileEndsWithAWholeRecordAndGoesOnWhenThereIsRoom) {
    const auto sink = opened(true);
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    rlimit tight = before;
    tight.rlim_cur = kFileHeader + 3 * (kRecordHeader + kHeaders + 1206) + 700;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (std::uint64_t i = 0; i < 6; ++i) sink->send(PacketKind::data, payload(1206, i), 0);
    sink->flush();
    const std::size_t at_limit = records_of(test::read_bytes(path_)).size();
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    EXPECT_EQ(at_limit, 3U);
    EXPECT_EQ(sink->counters().sent, 3U);
    EXPECT_EQ(sink->counters().dropped, 3U);
    ASSERT_FALSE(sink->failure());
    EXPECT_NE(sink->failure().error().text().find("3 packets could not be written: File too large"),
              std::string::npos)
        << sink->failure().error().text();
    sink->send(PacketKind::data, payload(1206, 6), 0);
    sink->flush();
    EXPECT_EQ(records_of(test::read_bytes(path_)).size(), 4U);
}

TEST_F(PcapSink, SendingAllocatesNothing) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has its own heap";
    const auto sink = opened(true);
    const Bytes packet = payload(1206, 1);
    const test::AllocationCounter counter;
    for (int i = 0; i < 1000; ++i) sink->send(PacketKind::data, packet, i);
    sink->flush();
    EXPECT_EQ(counter.on_all_threads(), 0U);
    EXPECT_EQ(sink->counters().sent, 1000U);
}

TEST_F(PcapSink, RefusesMoreThanAnEthernetFrameHolds) {
    const auto sink = opened(true);
    EXPECT_TRUE(sink->send(PacketKind::data, payload(1472, 1), 0));
    EXPECT_FALSE(sink->send(PacketKind::data, payload(1473, 1), 0));
    sink->flush();
    EXPECT_EQ(sink->counters().sent, 1U);
    EXPECT_EQ(sink->counters().dropped, 1U);
}

TEST_F(PcapSink, ErrorNamesWhyItCannotWrite) {
    const std::string path = folder_ / "no/such/folder.pcap";
    const auto sink = open_packet_sink(path, vlp16().network, false);
    ASSERT_FALSE(sink);
    EXPECT_EQ(sink.error().kind, ErrorKind::missing);
    EXPECT_EQ(sink.error().text(), path + ": cannot write the capture: No such file or directory");
}

}  // namespace
}  // namespace narpa
