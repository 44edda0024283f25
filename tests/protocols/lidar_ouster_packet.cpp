// Ouster's packets: each field at its place, and packets that real sensors sent, byte for byte.
#include "protocols/lidar/ouster_packet.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/protocols/capture.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

using PacketBytes = std::vector<std::uint8_t>;

// Firmware manual, "Lidar Data Packet Format", with 32 beams; README.md, "Ouster".
TEST(OusterFormat, SizesOfThePackets) {
    const std::array<std::size_t, 4> sizes{6464, 6400, 8448, 2304};
    for (std::size_t i = 0; i < sizes.size(); ++i)
        EXPECT_EQ(OusterFormat(static_cast<OusterProfile>(i), 32).bytes(), sizes[i]) << kOusterProfiles[i];
    EXPECT_EQ(OusterFormat(OusterProfile::legacy, 64).bytes(), 12'608u);
    EXPECT_EQ(OusterFormat(OusterProfile::dual, 128).bytes(), 33'024u);
}

/// Writes one field after the other into a packet of zeros and returns which bits became set, counted from the
/// pixel's first one.
template <class Set>
std::vector<unsigned> bits_set_by(OusterProfile profile, const Set& set) {
    const OusterFormat format(profile, 16);
    const bool legacy = profile == OusterProfile::legacy;
    constexpr std::array<std::size_t, 4> pixel_bytes{12, 12, 16, 4};
    const std::size_t size = pixel_bytes[static_cast<std::size_t>(profile)], header = legacy ? 0 : 32,
                      column_header = legacy ? 16 : 12, column = column_header + 16 * size + (legacy ? 4 : 0);
    const std::size_t at = header + 2 * column + column_header + 5 * size;  // beam 5 of column 2
    PacketBytes packet(format.bytes());
    OusterPixel pixel;
    set(pixel);
    format.put(pixel, packet, 2, 5);
    std::vector<unsigned> bits;
    for (std::size_t byte = 0; byte < packet.size(); ++byte)
        for (unsigned bit = 0; bit < 8; ++bit)
            if ((packet[byte] >> bit & 1) != 0) bits.push_back(static_cast<unsigned>(8 * (byte - at)) + bit);
    return bits;
}

std::vector<unsigned> bits_from_to(unsigned first, unsigned last) {
    std::vector<unsigned> all;
    for (unsigned i = first; i <= last; ++i) all.push_back(i);
    return all;
}

TEST(OusterFormat, FieldsAreAtTheBitsThatTheMakerDocuments) {
    using enum OusterProfile;
    const auto range_mm = [](OusterPixel& p) { p.returns[0].range_mm = ~0u; };
    const auto flags = [](OusterPixel& p) { p.returns[0].flags = 0xFF; };
    const auto reflectivity = [](OusterPixel& p) { p.returns[0].reflectivity = 0xFF; };
    const auto signal = [](OusterPixel& p) { p.returns[0].signal = 0xFFFF; };
    const auto near_ir = [](OusterPixel& p) { p.near_ir = 0xFFFF; };
    const auto second = [](OusterPixel& p) { p.returns[1] = {~0u, 0xFF, 0xFF, 0xFFFF}; };

    EXPECT_EQ(bits_set_by(legacy, range_mm), bits_from_to(0, 19));
    EXPECT_EQ(bits_set_by(legacy, flags), bits_from_to(28, 31));
    for (const OusterProfile profile : {single, dual}) {
        EXPECT_EQ(bits_set_by(profile, range_mm), bits_from_to(0, 18));
        EXPECT_EQ(bits_set_by(profile, flags), bits_from_to(19, 23));
    }
    for (const OusterProfile profile : {legacy, single}) {
        EXPECT_EQ(bits_set_by(profile, reflectivity), bits_from_to(32, 39));
        EXPECT_EQ(bits_set_by(profile, signal), bits_from_to(48, 63));
        EXPECT_EQ(bits_set_by(profile, near_ir), bits_from_to(64, 79));
    }
    EXPECT_EQ(bits_set_by(dual, reflectivity), bits_from_to(24, 31));
    EXPECT_EQ(bits_set_by(dual, signal), bits_from_to(64, 79));
    EXPECT_EQ(bits_set_by(dual, near_ir), bits_from_to(96, 111));
    std::vector<unsigned> of_second = bits_from_to(32, 63);
    for (const unsigned bit : bits_from_to(80, 95)) of_second.push_back(bit);
    EXPECT_EQ(bits_set_by(dual, second), of_second);
    EXPECT_EQ(bits_set_by(low_bandwidth, range_mm), bits_from_to(0, 14));
    EXPECT_EQ(bits_set_by(low_bandwidth, flags), bits_from_to(15, 15));
    EXPECT_EQ(bits_set_by(low_bandwidth, reflectivity), bits_from_to(16, 23));
    EXPECT_EQ(bits_set_by(low_bandwidth, near_ir), bits_from_to(24, 31));
    for (const OusterProfile profile : {legacy, single, low_bandwidth})
        EXPECT_TRUE(bits_set_by(profile, second).empty());
}

struct Recording {
    const char* file;
    OusterProfile profile;
    int beams;
    std::size_t packets, returns;
    std::uint32_t init_id;
    std::uint64_t serial;
};

void PrintTo(const Recording& r, std::ostream* out) {
    *out << r.file;
}

class OusterRecording : public ::testing::TestWithParam<Recording> {};

// What the sensors' metadata state of themselves: init_id and prod_sn.
TEST_P(OusterRecording, IsReadAndWrittenByteForByte) {
    const Recording& r = GetParam();
    const OusterFormat format(r.profile, r.beams);
    const auto packets =
        test::captured_payloads(test::source_path("../shared/assets/lidar/ouster/") + r.file, format.bytes());
    if (packets.empty()) GTEST_SKIP() << "no capture beside the project: ../shared/assets/lidar/ouster";
    ASSERT_EQ(packets.size(), r.packets);
    std::size_t returns = 0;
    unsigned measurement = 0;
    for (const PacketBytes& bytes : packets) {
        PacketBytes again(bytes.size(), 0xAA);
        const OusterHeader header = format.header(bytes);
        EXPECT_EQ(header.packet_type, OusterHeader::kLidar);
        EXPECT_EQ(header.init_id, r.init_id);
        EXPECT_EQ(header.serial, r.serial);
        format.put(header, again);
        for (int c = 0; c < OusterFormat::kColumns; ++c) {
            const OusterColumn column = format.column(bytes, c);
            EXPECT_TRUE(format.is_valid(column));
            EXPECT_EQ(column.measurement_id, measurement++ % 1024);
            const bool has_encoder = r.profile == OusterProfile::legacy;
            EXPECT_EQ(column.encoder, has_encoder ? column.measurement_id * OusterColumn::kEncoderTurn / 1024 : 0);
            format.put(column, again, c);
            for (int beam = 0; beam < r.beams; ++beam) {
                const OusterPixel pixel = format.pixel(bytes, c, beam);
                returns += pixel.returns[0].range_mm > 0 ? 1 : 0;
                format.put(pixel, again, c, beam);
            }
        }
        ASSERT_EQ(again, bytes);
    }
    EXPECT_EQ(returns, r.returns);
}

INSTANTIATE_TEST_SUITE_P(
    Of, OusterRecording,
    ::testing::Values(Recording{"OS-1-64_1024x10_fw20.pcap", OusterProfile::legacy, 64, 64, 16'749, 0, 0},
                      Recording{"OS-0-32-U1_v2.2.0_1024x10.pcap", OusterProfile::dual, 32, 64, 21'631, 9'599'938,
                                992'137'000'142},
                      Recording{"OS-0-128-U1_v2.3.0_1024x10.pcap", OusterProfile::low_bandwidth, 128, 64, 97'299,
                                5'431'292, 122'150'000'150},
                      Recording{"OS-1-128_v2.3.0_1024x10_lb_n3.pcap", OusterProfile::low_bandwidth, 128, 192,
                                322'536, 7'109'750, 122'201'000'998}),
    [](const auto& recording) {
        std::string name = recording.param.file;
        std::erase_if(name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
        return name;
    });

}  // namespace
}  // namespace narpa
