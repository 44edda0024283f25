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
        EXPECT_TRUE(names.insert(row.name).second && codes.insert(row.v4l2).second) << row.name;
        const auto found = link_from_code(row.v4l2);
        ASSERT_TRUE(found);
        EXPECT_EQ(found->samples, row.samples);
        EXPECT_EQ(found->layout, row.layout);
        EXPECT_EQ(link_name(found->samples, found->layout), row.name);
    }
    EXPECT_EQ(link_from_code("Y16 ")->samples, PixelFormat::y16);
    EXPECT_TRUE(link_from_code("Y16 ")->layout.is_samples());
    EXPECT_FALSE(link_from_code("????"));
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

TEST(LinkLayout, PackedRowsNeedWholeGroups) {
    const LinkLayout p10{LinkLayout::Kind::mipi, 10}, p12{LinkLayout::Kind::mipi, 12};
    EXPECT_EQ(unfit_width(PixelFormat::y16, p10, 642),
              "Y10P holds 4 pixels together, expected a width that is a multiple of 4, not 642");
    EXPECT_EQ(unfit_width(PixelFormat::y16, p12, 642), "");
    EXPECT_NE(unfit_width(PixelFormat::y16, p12, 641), "");
    EXPECT_EQ(unfit_width(PixelFormat::y16, {}, 641), "");
}

}  // namespace
}  // namespace narpa
