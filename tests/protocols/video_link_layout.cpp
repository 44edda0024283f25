// Samples of 16 bits as links carry them, against the definitions bit by bit.
#include "protocols/video/link_layout.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

using Pixels = std::vector<std::uint8_t>;

/// Samples of an ADC of so many bits, left-justified.
Pixels samples_of(const VideoFormat& f) {
    std::mt19937 random(f.link.bits);
    Pixels frame(frame_bytes(f));
    for (std::size_t i = 0; i < frame.size(); i += 2)
        put_le(&frame[i], static_cast<std::uint16_t>(random() << (16 - f.link.bits)));
    return frame;
}
unsigned adc_value(const Pixels& samples, const VideoFormat& f, std::size_t pixel) {
    return get_le<std::uint16_t>(&samples[2 * pixel]) >> (16 - f.link.bits);
}
Pixels laid_out(const VideoFormat& f, const Pixels& samples) {
    Pixels out(link_bytes(f));
    lay_out(f, samples, out);
    return out;
}
std::vector<VideoFormat> all_formats() {
    std::vector<VideoFormat> formats;
    for (const LinkFormatRow& row : kLinkFormats) formats.push_back({24, 6, row.samples, 1, row.layout});
    return formats;
}

TEST(LinkLayout, NamesAndCodesAreThoseOfV4l2) {
    const auto code = [](std::string_view name) {
        const auto row = std::ranges::find(kLinkFormats, name, &LinkFormatRow::name);
        if (row == kLinkFormats.end()) return 0u;
        return v4l2_fourcc(row->v4l2[0], row->v4l2[1], row->v4l2[2], row->v4l2[3]);
    };
    EXPECT_EQ(code("Y10"), V4L2_PIX_FMT_Y10);
    EXPECT_EQ(code("Y12"), V4L2_PIX_FMT_Y12);
    EXPECT_EQ(code("Y14"), V4L2_PIX_FMT_Y14);
    EXPECT_EQ(code("Y10P"), V4L2_PIX_FMT_Y10P);
    EXPECT_EQ(code("RGGB10"), V4L2_PIX_FMT_SRGGB10);
    EXPECT_EQ(code("GRBG10"), V4L2_PIX_FMT_SGRBG10);
    EXPECT_EQ(code("GBRG10"), V4L2_PIX_FMT_SGBRG10);
    EXPECT_EQ(code("BGGR10"), V4L2_PIX_FMT_SBGGR10);
    EXPECT_EQ(code("RGGB12"), V4L2_PIX_FMT_SRGGB12);
    EXPECT_EQ(code("GRBG12"), V4L2_PIX_FMT_SGRBG12);
    EXPECT_EQ(code("GBRG12"), V4L2_PIX_FMT_SGBRG12);
    EXPECT_EQ(code("BGGR12"), V4L2_PIX_FMT_SBGGR12);
    EXPECT_EQ(code("RGGB14"), V4L2_PIX_FMT_SRGGB14);
    EXPECT_EQ(code("GRBG14"), V4L2_PIX_FMT_SGRBG14);
    EXPECT_EQ(code("GBRG14"), V4L2_PIX_FMT_SGBRG14);
    EXPECT_EQ(code("BGGR14"), V4L2_PIX_FMT_SBGGR14);
    EXPECT_EQ(code("RGGB10P"), V4L2_PIX_FMT_SRGGB10P);
    EXPECT_EQ(code("GRBG10P"), V4L2_PIX_FMT_SGRBG10P);
    EXPECT_EQ(code("GBRG10P"), V4L2_PIX_FMT_SGBRG10P);
    EXPECT_EQ(code("BGGR10P"), V4L2_PIX_FMT_SBGGR10P);
    EXPECT_EQ(code("RGGB12P"), V4L2_PIX_FMT_SRGGB12P);
    EXPECT_EQ(code("GRBG12P"), V4L2_PIX_FMT_SGRBG12P);
    EXPECT_EQ(code("GBRG12P"), V4L2_PIX_FMT_SGBRG12P);
    EXPECT_EQ(code("BGGR12P"), V4L2_PIX_FMT_SBGGR12P);
    std::set<std::string_view> names, codes;
    for (const LinkFormatRow& row : kLinkFormats) {
        EXPECT_TRUE(names.insert(row.name).second) << row.name;
        if (row.v4l2.empty()) continue;  // GenICam's
        EXPECT_TRUE(codes.insert(row.v4l2).second) << row.name;
        const auto found = link_from_code(std::string(row.v4l2));
        ASSERT_TRUE(found);
        EXPECT_EQ(found->samples, row.samples);
        EXPECT_EQ(found->layout, row.layout);
        EXPECT_EQ(link_name(found->samples, found->layout), row.name);
    }
    EXPECT_EQ(link_from_code("Y16 ")->samples, PixelFormat::y16);
    EXPECT_TRUE(link_from_code("Y16 ")->layout.is_samples());
    EXPECT_FALSE(link_from_code("????"));
    EXPECT_FALSE(link_from_code(""));
}

TEST(LinkLayout, PixelsAreWhereTheDefinitionSays) {
    for (const VideoFormat& f : all_formats()) {
        const Pixels samples = samples_of(f), link = laid_out(f, samples);
        const auto width = static_cast<std::size_t>(f.width);
        ASSERT_EQ(link.size(), link_row_bytes(f) * static_cast<std::size_t>(f.height));
        for (std::size_t i = 0; i < frame_bytes(f) / 2; ++i) {
            const unsigned value = adc_value(samples, f, i);
            const std::uint8_t* const row = &link[i / width * link_row_bytes(f)];
            const std::size_t x = i % width;
            if (f.link.kind == LinkLayout::Kind::right) {
                EXPECT_EQ(get_le<std::uint16_t>(&row[2 * x]), value) << link_name(f.pixel, f.link);
            } else if (f.link.kind ==
                       LinkLayout::Kind::genicam) {  // bit b of pixel x is bit x * bits + b of the row
                for (std::size_t b = 0; b < f.link.bits; ++b) {
                    const std::size_t bit = x * f.link.bits + b;
                    EXPECT_EQ(row[bit / 8] >> (bit % 8) & 1, value >> b & 1) << link_name(f.pixel, f.link);
                }
            } else if (f.link.bits == 10) {  // P1[9:2] P2[9:2] P3[9:2] P4[9:2] P4[1:0] P3[1:0] P2[1:0] P1[1:0]
                EXPECT_EQ(row[x / 4 * 5 + x % 4], value >> 2);
                EXPECT_EQ(row[x / 4 * 5 + 4] >> (2 * (x % 4)) & 3, value & 3);
            } else {  // P1[11:4] P2[11:4] P2[3:0] P1[3:0]
                EXPECT_EQ(row[x / 2 * 3 + x % 2], value >> 4);
                EXPECT_EQ(row[x / 2 * 3 + 2] >> (4 * (x % 2)) & 15, value & 15);
            }
        }
        Pixels back(samples.size());
        samples_of_link(f, link, back);
        EXPECT_EQ(back, samples) << link_name(f.pixel, f.link);
    }
}

TEST(LinkLayout, AnEmbeddedLineKeepsItsBytes) {
    for (VideoFormat f : all_formats()) {
        f.width = 240;
        f.link.first_bytes_kept = 160;
        Pixels samples = samples_of(f);
        const std::size_t row = 480;
        for (std::size_t i = 0; i < 160; ++i) samples[samples.size() - row + i] = static_cast<std::uint8_t>(i + 1);
        const Pixels link = laid_out(f, samples);
        for (std::size_t i = 0; i < 160; ++i)
            ASSERT_EQ(link[link.size() - link_row_bytes(f) + i], i + 1) << link_name(f.pixel, f.link);
        Pixels back(samples.size());
        samples_of_link(f, link, back);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const std::size_t in_last_row = i + row < samples.size() ? 0 : i + row - samples.size() + 1;
            if (in_last_row > 160 && in_last_row <= 260) continue;  // some of their bytes are the line's
            ASSERT_EQ(back[i], samples[i]) << link_name(f.pixel, f.link) << " " << i;
        }
    }
}

/// Codes of big-endian formats have V4L2's mark; packed ones and those of 8 bits have no byte order.
TEST(LinkLayout, BigEndianFormatsHaveV4l2sMark) {
    const std::string y16 = link_code(PixelFormat::y16, {.big_endian = true});
    EXPECT_EQ(v4l2_fourcc(y16[0], y16[1], y16[2], std::uint32_t{static_cast<std::uint8_t>(y16[3])}),
              V4L2_PIX_FMT_Y16_BE);
    const auto found = link_from_code(y16);
    ASSERT_TRUE(found);
    EXPECT_TRUE(found->layout.big_endian);
    EXPECT_FALSE(found->layout.is_samples());
    const LinkLayout r12{.kind = LinkLayout::Kind::right, .bits = 12, .big_endian = true};
    EXPECT_EQ(link_from_code(link_code(PixelFormat::y16, r12))->layout, r12);
    EXPECT_FALSE(link_from_code("GRE\xD9"));
    EXPECT_FALSE(link_from_code("Y12\xD0"));
    const LinkLayout packed{.kind = LinkLayout::Kind::mipi, .bits = 12, .big_endian = true};
    EXPECT_EQ(unfit_layout(PixelFormat::y16, packed, 640),
              "Y12P has no byte order, expected a format of 16 bits for a big-endian one");
    EXPECT_NE(unfit_layout(PixelFormat::yuyv, {.big_endian = true}, 640), "");
}

/// The same bytes as without, with the two of each element exchanged and zeros up to the end of each row.
TEST(LinkLayout, ByteOrderAndPaddingChangeNothingElse) {
    std::vector<VideoFormat> formats = all_formats();
    for (const PixelFormatRow& row : kPixelFormats) formats.push_back({24, 6, row.format, 1});
    for (const VideoFormat& plain : formats)
        for (const bool big : {false, true})
            for (const std::uint32_t padding : {0u, 1u, 40u}) {
                VideoFormat f = plain;
                const std::size_t pixels = link_row_bytes(plain), row = pixels + padding;
                f.link.big_endian = big;
                f.link.row_bytes = padding == 0 ? 0 : static_cast<std::uint32_t>(row);
                if (!unfit_layout(f.pixel, f.link, f.width).empty()) continue;
                Pixels samples(frame_bytes(plain));
                std::mt19937 random(7);
                for (std::uint8_t& byte : samples) byte = static_cast<std::uint8_t>(random());
                if (plain.link.kind != LinkLayout::Kind::samples) samples = samples_of(plain);
                Pixels expected;
                const Pixels without = laid_out(plain, samples);
                for (std::size_t y = 0; y < 6; ++y) {
                    for (std::size_t i = 0; i < pixels; ++i)
                        expected.push_back(without[y * pixels + (big ? i ^ 1 : i)]);
                    expected.resize(expected.size() + padding);
                }
                Pixels out(link_bytes(f), 0xAA), back(samples.size());
                lay_out(f, samples, out);
                EXPECT_EQ(out, expected) << link_text(f.pixel, f.link);
                samples_of_link(f, out, back);
                EXPECT_EQ(back, samples) << link_text(f.pixel, f.link);
            }
    LinkLayout rows{.row_bytes = 1279};
    EXPECT_EQ(unfit_layout(PixelFormat::y16, rows, 640),
              "rows of 1279 bytes, expected 1280 (the pixels of a row) to 1048576");
    EXPECT_FALSE(take_row_bytes(1279, 640, PixelFormat::y16, rows));
    EXPECT_TRUE(take_row_bytes(1280, 640, PixelFormat::y16, rows));
    EXPECT_EQ(rows.row_bytes, 0u);
    EXPECT_EQ(link_text(PixelFormat::y16, {.big_endian = true, .row_bytes = 1312}),
              "Y16-BE with rows of 1312 bytes");
}

TEST(LinkLayout, PackedRowsNeedWholeGroups) {
    const LinkLayout p10{LinkLayout::Kind::mipi, 10}, p12{LinkLayout::Kind::mipi, 12};
    EXPECT_EQ(unfit_layout(PixelFormat::y16, p10, 642),
              "Y10P holds 4 pixels together, expected a width that is a multiple of 4, not 642");
    EXPECT_EQ(unfit_layout(PixelFormat::y16, p12, 642), "");
    EXPECT_NE(unfit_layout(PixelFormat::y16, p12, 641), "");
    EXPECT_EQ(unfit_layout(PixelFormat::y16, {}, 641), "");
}

}  // namespace
}  // namespace narpa
