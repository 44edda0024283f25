// Protobuf messages and their descriptors, against bytes worked out by hand.
#include <gtest/gtest.h>

#include "protocols/foxglove/descriptors.h"
#include "protocols/foxglove/ledger_message.h"
#include "protocols/foxglove/messages.h"
#include "protocols/ledger_fields.h"
#include "tests/protocols/protobuf_reader.h"

namespace narpa::test {
namespace {

using Encoded = std::vector<std::uint8_t>;

template <ProtoMessage Message>
Encoded encoded(const Message& message) {
    Encoded out;
    encode_proto(message, out);
    return out;
}

TEST(FoxgloveMessages, VarintsHaveSevenBitsAByteLowestFirst) {
    Encoded out;
    for (const std::uint64_t value : {std::uint64_t{0}, std::uint64_t{127}, std::uint64_t{150}, UINT64_MAX})
        put_varint(out, value);
    EXPECT_EQ(out, (Encoded{0x00, 0x7F, 0x96, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01}));
}

TEST(FoxgloveMessages, TimestampsBeforeTimeZeroHavePositiveNanoseconds) {
    EXPECT_EQ(foxglove::timestamp(2'000'000'003).seconds, 2);
    EXPECT_EQ(foxglove::timestamp(2'000'000'003).nanos, 3);
    EXPECT_EQ(foxglove::timestamp(-1).seconds, -1);
    EXPECT_EQ(foxglove::timestamp(-1).nanos, 999'999'999);
    EXPECT_EQ(foxglove::timestamp(-1'000'000'000).seconds, -1);
    EXPECT_EQ(foxglove::timestamp(-1'000'000'000).nanos, 0);
    // 1: varint -1 of 64 bits; 2: varint 999,999,999 = 0x3B9AC9FF.
    EXPECT_EQ(encoded(foxglove::timestamp(-1)), (Encoded{0x08, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,
                                                         0x01, 0x10, 0xFF, 0x93, 0xEB, 0xDC, 0x03}));
}

TEST(FoxgloveMessages, AnImageIsEncodedFieldByField) {
    const Encoded pixels{9, 8, 7, 6};
    const foxglove::RawImage image{foxglove::timestamp(1'000'000'000), 2, 2, "mono8", 2, pixels, "c"};
    EXPECT_EQ(encoded(image), (Encoded{0x0A, 2, 0x08, 1,                                // 1: timestamp {1: 1}
                                       0x15, 2, 0,    0,   0,   0x1D, 2,    0, 0,  0,   // 2, 3: fixed32
                                       0x22, 5, 'm',  'o', 'n', 'o',  '8',              // 4: text
                                       0x2D, 2, 0,    0,   0,                           // 5: fixed32
                                       0x32, 4, 9,    8,   7,   6,    0x3A, 1, 'c'}));  // 6: bytes; 7: text
}

TEST(FoxgloveMessages, RepeatedNumbersArePackedAndZerosAreLeftOut) {
    const foxglove::CameraCalibration calibration{.D = {0, 1}};
    EXPECT_EQ(encoded(calibration), (Encoded{0x0A, 0,                                // 1: an empty timestamp
                                             0x2A, 16, 0, 0, 0, 0, 0,    0,   0, 0,  // 5: two doubles
                                             0,    0,  0, 0, 0, 0, 0xF0, 0x3F}));
}

TEST(FoxgloveMessages, LongNestedMessagesHaveLengthsOfSeveralBytes) {
    foxglove::FrameTransforms message;
    message.transforms.push_back({{}, std::string(200, 'p'), "c", {}, {}});
    const Encoded bytes = encoded(message);
    // 1: of 212 = 2 + (1 + 2 + 200) + 3 + 2 + 2 bytes.
    ASSERT_GT(bytes.size(), 3U);
    EXPECT_EQ(Encoded(bytes.begin(), bytes.begin() + 3), (Encoded{0x0A, 0xD4, 0x01}));
    EXPECT_EQ(bytes.size(), 3U + 212U);
}

TEST(FoxgloveMessages, AMissingPoseIsNoField) {
    const foxglove::Estimate lost{.frame = 7, .state = "lost"};
    const ProtoFields fields = read_proto(encoded(lost));
    EXPECT_EQ(fields.count(7), 0U);
    EXPECT_EQ(fields.find(4)->second.number, 7U);
    foxglove::Estimate known = lost;
    known.pose = foxglove::Pose{};
    EXPECT_EQ(read_proto(encoded(known)).count(7), 1U) << "an identity at the origin is a pose";
}

/// Fields of the only message of a FileDescriptorProto: name and type by number.
std::map<int, std::pair<std::string, int>> fields_in(const Encoded& file) {
    std::map<int, std::pair<std::string, int>> fields;
    const ProtoFields message = read_proto(read_proto(file).find(4)->second.bytes);
    for (auto [at, end] = message.equal_range(2); at != end; ++at) {
        const ProtoFields field = read_proto(at->second.bytes);
        fields[static_cast<int>(field.find(3)->second.number)] = {text_of(field.find(1)->second),
                                                                  static_cast<int>(field.find(5)->second.number)};
    }
    return fields;
}

TEST(FoxgloveMessages, DescriptorsHoldEachFileAfterThoseThatItNeeds) {
    const Encoded set = proto_descriptors<foxglove::PointCloud>();
    std::vector<std::string> names;
    const ProtoFields files = read_proto(set);
    for (auto [at, end] = files.equal_range(1); at != end; ++at) {
        const ProtoFields file = read_proto(at->second.bytes);
        for (auto [used, last] = file.equal_range(3); used != last; ++used)
            EXPECT_NE(std::find(names.begin(), names.end(), text_of(used->second)), names.end());
        names.push_back(text_of(file.find(1)->second));
        EXPECT_EQ(text_of(file.find(12)->second), "proto3");
    }
    EXPECT_EQ(names, (std::vector<std::string>{"google/protobuf/timestamp.proto", "foxglove/Vector3.proto",
                                               "foxglove/Quaternion.proto", "foxglove/Pose.proto",
                                               "foxglove/PackedElementField.proto", "foxglove/PointCloud.proto"}));
    const auto last = std::prev(files.end());
    EXPECT_EQ(fields_in(last->second.bytes), (std::map<int, std::pair<std::string, int>>{{1, {"timestamp", 11}},
                                                                                         {2, {"frame_id", 9}},
                                                                                         {3, {"pose", 11}},
                                                                                         {4, {"point_stride", 7}},
                                                                                         {5, {"fields", 11}},
                                                                                         {6, {"data", 12}}}));
}

TEST(FoxgloveMessages, TheLedgerHasTheColumnsOfTheLog) {
    const ProtoFields set = read_proto(ledger_message_descriptors());
    const auto fields = fields_in(set.find(1)->second.bytes);
    ASSERT_EQ(fields.size(), kLedgerColumns.size() + 1);
    for (std::size_t i = 0; i < kLedgerColumns.size(); ++i)
        EXPECT_EQ(fields.at(static_cast<int>(i) + 1).first, kLedgerColumns[i].name);

    FrameLedger ledger;
    ledger.frame = 300;
    ledger.t_pose_ns = -5;
    ledger.delivery = Delivery::blank;
    ledger.passes = {4, 5};
    ledger.expected_error = 0.5F;
    Encoded out;
    encode_ledger_message(ledger, 0xDEADBEEF, out);
    const ProtoFields read = read_proto(out);
    const auto value = [&](const char* name) {
        for (const auto& [number, field] : fields)
            if (field.first == name && read.count(number) == 1) return read.find(number)->second;
        ADD_FAILURE() << name;
        return ProtoValueRead{};
    };
    EXPECT_EQ(value("frame").number, 300U);
    EXPECT_EQ(static_cast<std::int64_t>(value("t_pose_ns").number), -5);
    EXPECT_EQ(text_of(value("delivery")), "blank");
    EXPECT_EQ(text_of(value("step")), "refined");
    EXPECT_EQ(value("passes").bytes, (Encoded{4, 5}));
    EXPECT_EQ(value("expected_error").number, 0x3F000000U);
    EXPECT_EQ(value("image_crc32").number, 0xDEADBEEFU);
}

}  // namespace
}  // namespace narpa::test
