// What a GigE Vision client is told of the camera.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "protocols/video/gige_description.h"

namespace narpa {
namespace {

/// Bits 16 to 23 of a code are the bits of a pixel: what a client computes the size of a frame from.
TEST(GigeVision, CodesHaveTheSizeOfTheLinksPixels) {
    std::set<std::uint32_t> codes;
    std::size_t refused = 0;
    const auto check = [&](const VideoFormat& format) {
        const auto pixels = gige_pixel_format(format);
        if (!pixels) return ++refused, void();
        EXPECT_EQ((pixels->code >> 16 & 0xFF) * 64 * 48 / 8, link_bytes(format)) << pixels->name;
        EXPECT_EQ(pixels->code >> 24,
                  format.pixel == PixelFormat::rgb24 || format.pixel == PixelFormat::yuyv ? 2u : 1u);
        EXPECT_TRUE(codes.insert(pixels->code).second) << pixels->name;
    };
    for (const PixelFormatRow& row : kPixelFormats) check({64, 48, row.format, 100'000'000});
    for (const LinkFormatRow& row : kLinkFormats) check({64, 48, row.samples, 100'000'000, row.layout});
    EXPECT_EQ(codes.size(), 33u);
    EXPECT_EQ(refused, 14u) << "ten that are packed as MIPI does, and mosaics of 14 bits";
}

/// From the Pixel Format Naming Convention.
TEST(GigeVision, CodesAreThoseOfTheConvention) {
    const std::map<std::string_view, std::uint32_t> expected{
        {"Mono8", 0x01080001},    {"Mono12", 0x01100005},    {"Mono16", 0x01100007},    {"RGB8", 0x02180014},
        {"YUV422_8", 0x02100032}, {"BayerRG8", 0x01080009},  {"BayerBG12", 0x01100013}, {"Mono10p", 0x010A0046},
        {"Mono12p", 0x010C0047},  {"BayerRG12p", 0x010C0059}};
    std::size_t found = 0;
    const auto check = [&](const VideoFormat& format) {
        const auto pixels = gige_pixel_format(format);
        if (!pixels || !expected.contains(pixels->name)) return;
        EXPECT_EQ(pixels->code, expected.at(pixels->name)) << pixels->name;
        ++found;
    };
    for (const PixelFormatRow& row : kPixelFormats) check({64, 48, row.format, 100'000'000});
    for (const LinkFormatRow& row : kLinkFormats) check({64, 48, row.samples, 100'000'000, row.layout});
    EXPECT_EQ(found, expected.size());
}

TEST(GigeVision, FormatsWithoutACodeAreNamed) {
    const auto packed = gige_pixel_format({64, 48, PixelFormat::y16, 1, {LinkLayout::Kind::mipi, 12}});
    ASSERT_FALSE(packed);
    EXPECT_EQ(packed.error().what,
              "GigE Vision has no pixel format Y12P; it carries GREY, Y10, Y12, Y14, Y16, RGB24, YUYV, Mono10p, "
              "Mono12p, and mosaics of "
              "8, 10, 12 and 16 bits, packed as BayerRG10p or not");
}

TEST(GigeVision, DescriptionHasTheFormatAndNothingToChange) {
    const VideoFormat format{640, 480, PixelFormat::y16, 40'000'000, {LinkLayout::Kind::right, 12}};
    const std::string text = gige_description(format, *gige_pixel_format(format),
                                              {.width = 256,
                                               .height = 260,
                                               .pixel_format = 296,
                                               .sensor_width = 284,
                                               .sensor_height = 280,
                                               .acquisition = 292});
    const auto has = [&](const std::string& part) { return text.find(part) != std::string::npos; };
    EXPECT_TRUE(has("<EnumEntry Name=\"Mono12\" NameSpace=\"Standard\"><Value>17825797</Value></EnumEntry>"));
    EXPECT_TRUE(
        has("<IntReg Name=\"Width\" NameSpace=\"Standard\"><Address>256</Address><Length>4</Length>"
            "<AccessMode>RO</AccessMode>"));
    EXPECT_TRUE(has("<Integer Name=\"PayloadSize\" NameSpace=\"Standard\"><Value>614400</Value></Integer>"));
    EXPECT_TRUE(has("<Float Name=\"AcquisitionFrameRate\" NameSpace=\"Standard\"><Value>25</Value>"));
    std::size_t writable = 0;
    for (std::size_t at = 0; (at = text.find("<AccessMode>RW", at)) != std::string::npos; ++at) ++writable;
    EXPECT_EQ(writable, 1u) << "the start and stop of the acquisition";
    // Each feature that a category or a command names is there.
    for (std::size_t at = 0; (at = text.find("<pFeature>", at)) != std::string::npos;) {
        at += 10;
        EXPECT_TRUE(has(" Name=\"" + text.substr(at, text.find('<', at) - at) + "\"")) << text.substr(at, 30);
    }
}

}  // namespace
}  // namespace narpa
