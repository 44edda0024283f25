// Frames in datagrams: how they are cut, and put together from what comes.
#include "protocols/video/frame_datagram.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

using Datagrams = std::vector<std::vector<std::uint8_t>>;

std::vector<std::uint8_t> frame_of(const VideoFormat& format, std::uint32_t number) {
    std::mt19937 random(number);
    std::vector<std::uint8_t> frame(frame_bytes(format));
    for (auto& byte : frame) byte = static_cast<std::uint8_t>(random());
    return frame;
}

Datagrams datagrams_of(const VideoFormat& format, std::uint32_t number, std::size_t most) {
    const std::vector<std::uint8_t> frame = frame_of(format, number);
    const FrameCut cut = cut_into_frame_datagrams(format, most);
    Datagrams out;
    for (std::uint32_t i = 0; i < cut.count(); ++i) {
        const FrameCut::Part part = cut[i];
        const auto bytes = std::span(frame).subspan(part.begin, part.bytes);
        const auto head = encode_frame_datagram({.t_ns = number * 100,
                                                 .frame = number,
                                                 .pixel = format.pixel,
                                                 .width = static_cast<std::uint16_t>(format.width),
                                                 .height = static_cast<std::uint16_t>(format.height),
                                                 .index = i,
                                                 .count = cut.count(),
                                                 .row = part.row,
                                                 .byte_in_row = part.byte_in_row},
                                                bytes);
        auto& datagram = out.emplace_back(head.begin(), head.end());
        datagram.insert(datagram.end(), bytes.begin(), bytes.end());
        EXPECT_LE(datagram.size(), most);
    }
    return out;
}

constexpr VideoFormat kFormat{100, 60, PixelFormat::y16, 100'000'000};

TEST(FrameDatagram, PartsCoverTheFrameOnceForAnyLength) {
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24})
        for (const std::size_t most : {76u, 100u, 152u, 352u, 1472u, 4000u, 65507u}) {
            const VideoFormat format{100, 60, pixel, 100'000'000};
            const FrameCut cut = cut_into_frame_datagrams(format, most);
            std::size_t next = 0;
            for (std::uint32_t i = 0; i < cut.count(); ++i) {
                const FrameCut::Part part = cut[i];
                const std::size_t row_bytes = 100 * bytes_per_pixel(pixel);
                EXPECT_EQ(part.begin, next);
                EXPECT_EQ(part.begin, part.row * row_bytes + part.byte_in_row);
                EXPECT_GT(part.bytes, 0u);
                EXPECT_LE(part.bytes + kFrameDatagramHeaderBytes, most);
                EXPECT_TRUE(part.bytes % row_bytes == 0 || part.byte_in_row + part.bytes <= row_bytes);
                next += part.bytes;
            }
            EXPECT_EQ(next, frame_bytes(format)) << most;
        }
}

TEST(FrameDatagram, HeaderIsThatOfTheTable) {
    const std::vector<std::uint8_t> bytes{1, 2, 3, 4};
    const FrameDatagramHeader header{.t_ns = -2,
                                     .frame = 0x01020304,
                                     .pixel = PixelFormat::y16,
                                     .width = 640,
                                     .height = 480,
                                     .index = 7,
                                     .count = 9,
                                     .row = 5,
                                     .byte_in_row = 12};
    const auto head = encode_frame_datagram(header, bytes);
    const std::vector<std::uint8_t> expected{'N',  'R',  'P',  'D',  1, 0, 52, 0, 0xFE, 0xFF, 0xFF, 0xFF,
                                             0xFF, 0xFF, 0xFF, 0xFF, 4, 3, 2,  1, 'Y',  '1',  '6',  ' ',
                                             0x80, 2,    0xE0, 1,    0, 5, 0,  0, 7,    0,    0,    0,
                                             9,    0,    0,    0,    5, 0, 0,  0, 12,   0,    0,    0};
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), head.begin()));
    std::vector<std::uint8_t> datagram(head.begin(), head.end());
    datagram.insert(datagram.end(), bytes.begin(), bytes.end());
    std::vector<std::uint8_t> covered(expected);
    covered.insert(covered.end(), bytes.begin(), bytes.end());
    const std::uint32_t crc = crc32(covered);
    EXPECT_EQ(get_le<std::uint32_t>(&datagram[48]), crc);
    EXPECT_EQ(decode_frame_datagram(datagram), header);
}

TEST(FrameDatagram, DamagedOnesAreRefused) {
    const auto good = datagrams_of(kFormat, 1, 500)[3];
    ASSERT_TRUE(decode_frame_datagram(good));
    for (std::size_t at = 0; at < good.size(); ++at) {
        auto bad = good;
        bad[at] ^= 0x10;
        EXPECT_FALSE(decode_frame_datagram(bad)) << at;
    }
    for (std::size_t size = 0; size < good.size(); ++size)
        EXPECT_FALSE(decode_frame_datagram(std::span(good).first(size))) << size;
    // A place outside the frame, with a right CRC.
    const std::vector<std::uint8_t> bytes(200);
    for (const FrameDatagramHeader& h :
         {FrameDatagramHeader{.width = 100, .height = 2, .count = 1, .row = 1, .byte_in_row = 0},
          FrameDatagramHeader{.width = 100, .height = 2, .count = 1, .row = 0, .byte_in_row = 100},
          FrameDatagramHeader{.width = 100, .height = 2, .index = 1, .count = 1},
          FrameDatagramHeader{.width = 100, .height = 2, .count = 201},
          FrameDatagramHeader{.width = 100, .height = 2, .count = 1, .row = 0xFFFFFFFF, .byte_in_row = 0}}) {
        const auto head = encode_frame_datagram(h, bytes);
        std::vector<std::uint8_t> datagram(head.begin(), head.end());
        datagram.insert(datagram.end(), bytes.begin(), bytes.end());
        EXPECT_FALSE(decode_frame_datagram(datagram));
    }
}

TEST(FrameAssembly, FramesComeOutWholeWhateverTheOrderInThem) {
    std::mt19937 random(3);
    FrameAssembly assembly(kFormat);
    for (std::uint32_t number = 0xFFFFFFFE; number != 3; ++number) {
        Datagrams datagrams = datagrams_of(kFormat, number, 300);
        std::ranges::shuffle(datagrams, random);
        for (std::size_t i = 0; i < datagrams.size(); ++i) {
            const FrameAssembly::Frame* whole = assembly.take(datagrams[i]);
            ASSERT_EQ(whole != nullptr, i + 1 == datagrams.size());
            if (whole == nullptr) continue;
            EXPECT_EQ(whole->number, number);
            EXPECT_EQ(whole->t_ns, number * 100);
            EXPECT_EQ(whole->bytes, frame_of(kFormat, number));
        }
    }
    EXPECT_EQ(assembly.counters().whole, 5u);
    EXPECT_EQ(assembly.counters().missing, 0u) << "the number wraps";
    EXPECT_EQ(assembly.counters().refused, 0u);
}

TEST(FrameAssembly, CountsWhatIsLost) {
    FrameAssembly assembly(kFormat);
    std::vector<std::uint32_t> whole;
    const auto take = [&](const std::vector<std::uint8_t>& datagram) {
        if (const auto* frame = assembly.take(datagram)) whole.push_back(frame->number);
    };
    const auto all = [&](std::uint32_t number, std::size_t but) {
        const Datagrams datagrams = datagrams_of(kFormat, number, 300);
        for (std::size_t i = 0; i < datagrams.size(); ++i)
            if (i != but) take(datagrams[i]);
    };
    constexpr std::size_t kNone = 1000;
    all(1, kNone);
    all(2, 5);
    all(3, kNone);  // 4 and 5 never come
    all(6, kNone);
    EXPECT_EQ(whole, (std::vector<std::uint32_t>{1, 3, 6}));
    EXPECT_EQ(assembly.counters().incomplete, 1u);
    EXPECT_EQ(assembly.counters().lost, 1u);
    EXPECT_EQ(assembly.counters().missing, 2u);
    take(datagrams_of(kFormat, 2, 300)[5]);
    take(datagrams_of(kFormat, 6, 300)[0]);
    EXPECT_EQ(assembly.counters().refused, 2u) << "too late";
}

TEST(FrameAssembly, TakesDatagramsOfTwoFramesInAnyOrder) {
    FrameAssembly assembly(kFormat);
    const Datagrams first = datagrams_of(kFormat, 8, 300), second = datagrams_of(kFormat, 9, 300);
    for (std::size_t i = 0; i + 1 < first.size(); ++i) EXPECT_EQ(assembly.take(first[i]), nullptr);
    EXPECT_EQ(assembly.take(second[0]), nullptr);
    EXPECT_EQ(assembly.take(second[0]), nullptr) << "twice";
    const FrameAssembly::Frame* whole = assembly.take(first.back());
    ASSERT_NE(whole, nullptr);
    EXPECT_EQ(whole->bytes, frame_of(kFormat, 8));
    for (std::size_t i = 1; i < second.size(); ++i) whole = assembly.take(second[i]);
    ASSERT_NE(whole, nullptr);
    EXPECT_EQ(whole->bytes, frame_of(kFormat, 9));
    EXPECT_EQ(assembly.counters().incomplete, 0u);
    EXPECT_EQ(assembly.counters().refused, 1u);
}

TEST(FrameAssembly, GoesOnWithASenderThatBeginsAgain) {
    FrameAssembly assembly(kFormat);
    for (const std::uint32_t number : {1000u, 1001u, 0u, 1u}) {
        const FrameAssembly::Frame* whole = nullptr;
        for (const auto& datagram : datagrams_of(kFormat, number, 300)) whole = assembly.take(datagram);
        ASSERT_NE(whole, nullptr) << number;
        EXPECT_EQ(whole->number, number);
    }
    EXPECT_EQ(assembly.counters().missing, 0u);
}

TEST(FrameAssembly, NamesAnotherFormat) {
    FrameAssembly assembly(kFormat);
    const VideoFormat other{64, 48, PixelFormat::grey, 100'000'000};
    EXPECT_EQ(assembly.take(datagrams_of(other, 1, 300)[0]), nullptr);
    ASSERT_TRUE(assembly.other_format());
    EXPECT_EQ(assembly.other_format()->width, 64);
    EXPECT_EQ(assembly.other_format()->pixel, PixelFormat::grey);
    EXPECT_EQ(assembly.counters().refused, 1u);
}

}  // namespace
}  // namespace narpa
