// What image files declare of their samples is used, or named in a warning or an error. The files are written here
// sample by sample, so the right values are known.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <random>

#include "renderer/assets/images/point_spread_file.h"
#include "renderer/assets/images/texture_file.h"
#include "renderer/image/image_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/campaign.h"
#include "tests/support/expect_has.h"
#include "tests/support/image_bytes.h"
#include "tests/support/image_files.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Colour = TextureUse::Colour;

std::string pnm(const std::string& head, int size, const std::vector<int>& samples) {
    std::string out = head;
    for (const int v : samples) out += bytes_of(static_cast<std::uint64_t>(v), size, true);
    return out;
}

std::string gama(double gamma) {
    return png_chunk("gAMA", bytes_of(static_cast<std::uint64_t>(std::lround(1e5 * gamma)), 4, true));
}

/// With `chunks` after the header, which has 8 + 25 bytes.
std::string png_with(const cv::Mat& image, const std::string& chunks) {
    std::vector<unsigned char> bytes;
    image_codecs("")->imencode(".png", image, bytes, {});
    std::string file(bytes.begin(), bytes.end());
    return file.insert(33, chunks);
}

/// What became of a file: its samples, its warnings, or its error.
struct Reading {
    std::vector<std::uint16_t> rgb;
    std::string warnings, error;
    int width = 0, height = 0;

    Reading(const std::string& bytes, Colour colour = Colour::by_depth) {
        std::vector<std::string> all;
        const Result<Texture> t = decode_texture(
            "t", {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, {.colour = colour}, &all);
        for (const std::string& w : all) warnings += w + "\n";
        if (t)
            rgb = t->rgb, width = t->width, height = t->height;
        else
            error = t.error().text();
    }
    [[nodiscard]] double red(std::size_t pixel) const {
        return pixel * 3 < rgb.size() ? rgb[3 * pixel] / 65535.0 : -1;
    }
};

TEST(ImageDeclarations, MaxvalIsFullScale) {
    const Reading twelve(pnm("P5 3 1 4095\n", 2, {4095, 2048, 0}), Colour::linear),
        four(pnm("P5\n# of four bits\n2 1\n15\n", 1, {15, 7}), Colour::linear),
        text("P2 2 1 100 100 25", Colour::linear), colours(pnm("P6 1 1 1000\n", 2, {1000, 500, 0}), Colour::linear),
        srgb(pnm("P5 1 1 15\n", 1, {7}));
    EXPECT_EQ(twelve.red(0), 1);
    EXPECT_NEAR(twelve.red(1), 2048 / 4095.0, 1e-5);
    EXPECT_EQ(four.red(0), 1);
    EXPECT_NEAR(four.red(1), 7 / 15.0, 1e-5);
    EXPECT_EQ(text.red(0), 1);
    EXPECT_NEAR(text.red(1), 0.25, 1e-5);
    EXPECT_EQ(colours.rgb, (std::vector<std::uint16_t>{65535, 32768, 0}));
    EXPECT_NEAR(srgb.red(0), std::pow((7 / 15.0 + 0.055) / 1.055, 2.4), 1e-5);
    EXPECT_HAS(Reading(pnm("P5 1 1 15\n", 1, {16})).error, "a sample of 16, expected at most its maxval, 15");
    EXPECT_HAS(Reading("P5 1 1 0\n1").error, "whose maxval is 0, expected 1 to 65535");
    EXPECT_HAS(Reading("P5 1 1 70000\n11").error, "whose maxval is 70000");
}

TEST(ImageDeclarations, NoSideIsLongerThanAMillionPixels) {
    EXPECT_HAS(Reading("P5 1048577 1 255\n").error,
               "an image of 1048577 x 1 pixels, expected at most 1048576 in each");
}

TEST(ImageDeclarations, PamIsRead) {
    const auto head = [](int depth, int largest, const std::string& kind) {
        return fmt::format("P7\n# comment\nWIDTH 2\nHEIGHT 1\nDEPTH {}\nMAXVAL {}\nTUPLTYPE {}\nENDHDR\n", depth,
                           largest, kind);
    };
    const Reading grey(pnm(head(1, 1000, "GRAYSCALE"), 2, {1000, 250}), Colour::linear),
        alpha(pnm(head(2, 15, "GRAYSCALE_ALPHA"), 1, {15, 0, 3, 15}), Colour::linear),
        colours(pnm(head(4, 255, "RGB_ALPHA"), 1, {255, 51, 0, 9, 0, 0, 255, 9}), Colour::linear),
        bitmap(pnm(head(1, 1, "BLACKANDWHITE"), 1, {0, 1}));
    EXPECT_EQ(grey.red(0), 1);
    EXPECT_NEAR(grey.red(1), 0.25, 1e-5);
    EXPECT_EQ(alpha.red(0), 1);
    EXPECT_NEAR(alpha.red(1), 0.2, 1e-5);
    EXPECT_EQ(colours.rgb, (std::vector<std::uint16_t>{65535, 13107, 0, 0, 0, 65535}));
    EXPECT_EQ(bitmap.red(0), 0);
    EXPECT_EQ(bitmap.red(1), 1);
    EXPECT_HAS(Reading(pnm(head(3, 255, "CMYK"), 1, {1, 2, 3, 4, 5, 6})).error,
               "a PAM of 3 samples a pixel, \"CMYK\"");
    EXPECT_HAS(Reading(pnm(head(1, 255, "GRAYSCALE"), 1, {1})).error, "damaged, or cut short");
}

TEST(ImageDeclarations, FramesArePartsOfTheirMaxval) {
    const MemoryFolder folder;
    Camera c = camera(2, 1, 10);
    const auto code = [&](const std::string& file, std::size_t pixel) {
        const auto frame = read_frame(folder / file, c);
        EXPECT_TRUE(frame) << frame.error().text();
        if (!frame) return -1;
        return is_16_bit(c.format) ? (*frame)[2 * pixel] | (*frame)[2 * pixel + 1] << 8 : (*frame)[pixel];
    };
    folder.write("ten.pgm", pnm("P5 2 1 1023\n", 2, {1023, 512}));
    folder.write("four.pgm", pnm("P5 2 1 15\n", 1, {15, 7}));
    folder.write("odd.pgm", pnm("P5 2 1 5000\n", 2, {5000, 7}));
    c.format = PixelFormat::y16;
    EXPECT_EQ(code("ten.pgm", 0), 65535);
    EXPECT_EQ(code("ten.pgm", 1), std::lround(65535 * 512 / 1023.0));
    c.detector = Detector{.bits = 10};
    EXPECT_EQ(code("ten.pgm", 0), 65535 - 63);
    EXPECT_EQ(code("ten.pgm", 1), 512 * 64);
    c.detector->bits = 12;
    EXPECT_EQ(code("ten.pgm", 0), 65535 - 15);
    EXPECT_EQ(code("ten.pgm", 1), std::lround(4095 * 512 / 1023.0) * 16);
    c.detector->bits = 9;
    const auto fine = read_frame(folder / "ten.pgm", c);
    ASSERT_FALSE(fine);
    EXPECT_HAS(fine.error().what, "has numbers of more than the 9 bits");
    const auto odd = read_frame(folder / "odd.pgm", c);
    ASSERT_FALSE(odd);
    EXPECT_HAS(odd.error().what, "has samples up to 5000, expected up to 511");
    c.detector.reset();
    c.format = PixelFormat::grey;
    EXPECT_EQ(code("four.pgm", 0), 255);
    EXPECT_EQ(code("four.pgm", 1), 119);
}

TEST(ImageDeclarations, FramesUseTheSignificantBitsOfPng) {
    const MemoryFolder folder;
    cv::Mat1w image(1, 2);
    image(0, 0) = 0xabc << 4 | 0xabc >> 8, image(0, 1) = 0xfff << 4 | 0xf;
    folder.write("twelve.png", png_with(image, png_chunk("sBIT", "\x0c") + gama(0.5)));
    Camera c = camera(2, 1, 10);
    c.format = PixelFormat::y16;
    c.detector = Detector{.bits = 12};
    std::vector<std::string> warnings;
    const auto frame = read_frame(folder / "twelve.png", c, &warnings);
    ASSERT_TRUE(frame) << frame.error().text();
    EXPECT_EQ(*frame, (std::vector<std::uint8_t>{0xc0, 0xab, 0xf0, 0xff}));
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_HAS(warnings[0], "twelve.png: it declares a gamma of 0.5, and is read as linear in light");
    folder.write("alpha.png", png_with(cv::Mat(1, 2, CV_16UC4, cv::Scalar(1, 1, 1, 1)), ""));
    const auto alpha = read_frame(folder / "alpha.png", c);
    ASSERT_FALSE(alpha);
    EXPECT_HAS(alpha.error().what, "is colour with alpha of 16 bits, expected grey of 16 bits");
}

TEST(ImageDeclarations, PlanesOfTiffAreTheirBands) {
    const Code red = [](int x, int, int band) { return band == x ? 65535u : 0u; };
    for (const int photometric : {1, 2}) {
        const Reading r(TiffFile{.bands = 3, .bits = 16, .photometric = photometric, .planes = 2}.bytes(red));
        EXPECT_EQ(r.rgb, (std::vector<std::uint16_t>{65535, 0, 0, 0, 65535, 0})) << r.error;
        EXPECT_EQ(r.warnings.empty(), photometric == 2) << r.warnings;
    }
}

TEST(ImageDeclarations, WhiteIsZeroAtAllDepthsOfTiff) {
    for (const int bits : {1, 2, 4, 8, 12, 16, 32}) {
        const std::uint64_t largest = (std::uint64_t{1} << bits) - 1;
        const Reading r(
            TiffFile{.bits = bits, .photometric = 0}.bytes([&](int x, int, int) { return x == 0 ? largest : 0; }));
        EXPECT_EQ(r.red(0), 0) << bits << r.error;
        EXPECT_EQ(r.red(1), 1) << bits;
        EXPECT_EQ(r.warnings, "");
    }
}

TEST(ImageDeclarations, BigTiffIsRead) {
    for (const bool is_big_endian : {false, true}) {
        const TiffFile file{
            .bands = 3, .photometric = 2, .planes = 2, .is_bigtiff = true, .is_big_endian = is_big_endian};
        const Reading r(file.bytes([](int, int, int band) { return band == 0 ? 255u : 0u; }));
        EXPECT_EQ(r.rgb, (std::vector<std::uint16_t>{65535, 0, 0, 65535, 0, 0})) << r.error;
    }
}

TEST(ImageDeclarations, FloatsOfTiffAreFromZeroToOne) {
    const auto single = [](float a, float b) {
        return TiffFile{.bits = 32, .format = 3}.bytes(
            [=](int x, int, int) { return std::bit_cast<std::uint32_t>(x == 0 ? a : b); });
    };
    const Reading r(single(1, 0.5f)), above(single(1.5f, 0)), nothing(single(0, NAN)),
        twice(TiffFile{.bits = 64, .format = 3}.bytes(
            [](int, int, int) { return std::bit_cast<std::uint64_t>(0.25); }));
    EXPECT_EQ(r.red(0), 1) << r.error;
    EXPECT_NEAR(r.red(1), 0.5, 1e-5);
    EXPECT_NEAR(twice.red(0), 0.25, 1e-5);
    EXPECT_HAS(above.error, "has a floating-point sample of 1.5, expected 0 to 1");
    EXPECT_HAS(nothing.error, "has a floating-point sample of nan");
}

TEST(ImageDeclarations, OtherSamplesOfTiffAreRefusedByName) {
    const Code zero = [](int, int, int) { return 0u; };
    const auto error = [&](const TiffFile& file) { return Reading(file.bytes(zero)).error; };
    EXPECT_HAS(error({.bits = 16, .format = 2}), "t: has signed integer samples of 16 bits, expected unsigned");
    EXPECT_HAS(error({.bits = 16, .format = 3}), "has floating-point samples of 16 bits");
    EXPECT_HAS(error({.bits = 24}), "has integer samples of 24 bits");
    EXPECT_HAS(error({.bits = 64, .format = 6}), "has complex samples of 64 bits");
    EXPECT_HAS(error({.bands = 4, .bits = 16, .photometric = 5}),
               "separated (CMYK) with 16 bits, expected 8, or RGB");
    EXPECT_HAS(error({.bands = 3, .bits = 16, .photometric = 6}), "YCbCr with 16 bits");
    EXPECT_HAS(error({.bits = 16, .photometric = 32803}), "colour filter array");
    EXPECT_HAS(error({.bands = 2, .photometric = 2}), "has 2 bands, expected 3");
    const std::string whole = TiffFile{.bits = 16}.bytes(zero);
    EXPECT_HAS(Reading(whole.substr(0, whole.size() - 3)).error, "damaged, or cut short");
}

TEST(ImageDeclarations, PalettesInksAndTurnsOfTiffAreUsed) {
    TiffFile palette{.bits = 2, .photometric = 3, .palette = {}};
    for (const std::uint64_t v : {0, 65535, 0, 0, 0, 0, 65535, 0, 0, 0, 0, 65535}) palette.palette.push_back(v);
    const Reading r(palette.bytes([](int x, int, int) { return x == 0 ? 1u : 3u; }));
    EXPECT_EQ(r.rgb, (std::vector<std::uint16_t>{65535, 0, 0, 0, 0, 65535})) << r.error;
    const Reading inks(
        TiffFile{.bands = 4, .photometric = 5}.bytes([](int x, int, int band) { return band == x ? 255u : 0u; }));
    EXPECT_EQ(inks.rgb, (std::vector<std::uint16_t>{0, 65535, 65535, 65535, 0, 65535})) << inks.error;
    EXPECT_HAS(inks.warnings, "its inks (CMYK) are converted without a profile");
    const Reading turned(TiffFile{.height = 2, .bits = 16, .orientation = 6}.bytes(
        [](int x, int y, int) { return static_cast<std::uint64_t>(1 + x + 2 * y); }));
    EXPECT_EQ((std::array{turned.rgb[0], turned.rgb[3], turned.rgb[6], turned.rgb[9]}),
              (std::array<std::uint16_t, 4>{3, 1, 4, 2}));
    const Reading premultiplied(
        TiffFile{.bands = 4, .photometric = 2, .extra = {1}}.bytes([](int, int, int) { return 7u; }));
    EXPECT_HAS(premultiplied.warnings, "its colours are multiplied by alpha");
    const Reading five(
        TiffFile{.bands = 5, .photometric = 2, .extra = {2, 0}}.bytes([](int, int, int) { return 7u; }));
    EXPECT_HAS(five.warnings, "the last 1 of its bands are not used");
}

TEST(ImageDeclarations, GammaOfPngIsTheCurve) {
    const cv::Mat grey(1, 1, CV_8UC1, cv::Scalar(128));
    const double s = 128 / 255.0, srgb = std::pow((s + 0.055) / 1.055, 2.4);
    const std::string primaries = [] {
        std::string data;
        for (const int v : {31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000})
            data += bytes_of(static_cast<std::uint64_t>(v), 4, true);
        return png_chunk("cHRM", data);
    }();
    const std::string is_srgb = png_chunk("sRGB", std::string(1, '\0'));
    struct Case {
        std::string chunks;
        Colour colour;
        double value;
        const char* warning = "";
    };
    for (const auto& [chunks, colour, value, warning] :
         {Case{gama(1), Colour::by_depth, s}, Case{gama(0.5), Colour::by_depth, s * s},
          Case{gama(0.45455), Colour::by_depth, std::pow(s, 1 / 0.45455)},
          Case{primaries + gama(0.45455), Colour::by_depth, srgb}, Case{gama(1) + is_srgb, Colour::by_depth, srgb},
          Case{png_chunk("cICP", std::string("\x01\x08\x00\x01", 4)) + gama(0.5), Colour::by_depth, s},
          Case{gama(1), Colour::linear, s}, Case{gama(0.45455), Colour::srgb, srgb},
          Case{gama(1), Colour::srgb, srgb, "it declares linear light, and is read as sRGB"},
          Case{gama(0.5), Colour::linear, s, "it declares a gamma of 0.5, and is read as linear light"},
          Case{is_srgb, Colour::linear, s, "it declares sRGB, and is read as linear light"},
          Case{png_chunk("iCCP", std::string("Wide\0\0x", 7)), Colour::by_depth, srgb,
               "its ICC profile \"Wide\" is not used"}}) {
        const Reading r(png_with(grey, chunks), colour);
        EXPECT_NEAR(r.red(0), value, 1e-5) << chunks << r.error;
        EXPECT_EQ(r.warnings.empty(), std::string(warning).empty()) << r.warnings;
        EXPECT_HAS(r.warnings, warning);
    }
    const Reading sixteen(png_with(cv::Mat(1, 1, CV_16UC1, cv::Scalar(32896)), is_srgb));
    EXPECT_NEAR(sixteen.red(0), srgb, 1e-5);
}

TEST(ImageDeclarations, SignificantBitsOfPngAreUsedOrNamed) {
    const auto read = [](std::uint16_t a, std::uint16_t b, const std::string& bits) {
        cv::Mat1w image(1, 2);
        image(0, 0) = a, image(0, 1) = b;
        return Reading(png_with(image, png_chunk("sBIT", bits)), Colour::linear);
    };
    EXPECT_EQ(read(0xfff0, 0x8000, "\x0c").red(0), 1);
    EXPECT_NEAR(read(0xfff0, 0x8000, "\x0c").red(1), 2048 / 4095.0, 1e-5);
    EXPECT_NEAR(read(0xffff, 0x8008, "\x0c").red(1), 2048 / 4095.0, 1e-5);
    EXPECT_EQ(read(0xffff, 0x8008, "\x0c").warnings, "");
    EXPECT_HAS(read(4095, 17, "\x0c").warnings, "all samples are below 4096, and 65535 is read as 1");
    EXPECT_HAS(read(0x1234, 0xffff, "\x0c").warnings, "the samples have more");
}

TEST(ImageDeclarations, GreyWithAlphaOfSixteenBitsIsGrey) {
    // OpenCV writes no grey with alpha; PAM does.
    const Reading r(
        pnm("P7\nWIDTH 1\nHEIGHT 1\nDEPTH 2\nMAXVAL 65535\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n", 2, {1000, 7}));
    EXPECT_EQ(r.rgb, (std::vector<std::uint16_t>{1000, 1000, 1000}));
    const Reading tiff(TiffFile{.width = 1, .bands = 2, .bits = 16, .extra = {2}}.bytes(
        [](int, int, int band) { return band == 0 ? 1000u : 7u; }));
    EXPECT_EQ(tiff.rgb, r.rgb) << tiff.error;
    EXPECT_EQ(tiff.warnings, "");
}

TEST(ImageDeclarations, OtherFormatsAreRefusedByName) {
    EXPECT_HAS(Reading("\x76\x2f\x31\x01....").error, "has the format OpenEXR, expected PNG, JPEG, TIFF");
    EXPECT_HAS(Reading("PF\n1 1\n-1.0\n............").error, "has the format PFM");
    EXPECT_HAS(Reading("GIF89a..").error, "has the format GIF");
    EXPECT_HAS(Reading("whatever").error, "is no image that can be decoded, expected PNG");
    std::vector<unsigned char> bytes;
    image_codecs("")->imencode(".jpg", cv::Mat(8, 8, CV_8UC3, cv::Scalar(1, 2, 3)), bytes, {});
    std::string jpeg(bytes.begin(), bytes.end());
    std::string twelve = jpeg;
    twelve[jpeg.find("\xff\xc0") + 4] = 12;
    EXPECT_HAS(Reading(twelve).error, "is a JPEG of 12 bits a sample, expected 8");
    const std::string exif =
        std::string("Exif\0\0", 6) + TiffFile{.orientation = 6}.bytes([](int, int, int) { return 0u; });
    jpeg.insert(2, "\xff\xe1" + bytes_of(exif.size() + 2, 2, true) + exif);
    EXPECT_HAS(Reading(jpeg).warnings, "t: its Exif orientation, 6, is not applied");
    image_codecs("")->imencode(".bmp", cv::Mat(1, 1, CV_8UC4, cv::Scalar(1, 2, 3, 4)), bytes, {});
    std::string bmp(bytes.begin(), bytes.end());
    EXPECT_EQ(Reading(bmp).error, "");
    bmp[14] = 40, bmp[30] = 3;
    bmp.replace(54, 12, bytes_of(0xff, 4, false) + bytes_of(0xff00, 4, false) + bytes_of(0xff0000, 4, false));
    EXPECT_HAS(Reading(bmp).error, "is a BMP of 32 bits with the masks 0xff, 0xff00, 0xff0000");
}

struct Window {
    int x0, y0, x1, y1;
};
/// Channel Y with a head of light at (x, y) of the plane in which both windows lie.
void write_exr(const std::string& path, const Window& shown, const Window& data, int x, int y,
               const char* also = nullptr) {
    const Imath::Box2i box(Imath::V2i(data.x0, data.y0), Imath::V2i(data.x1, data.y1));
    Imf::Header header(Imath::Box2i(Imath::V2i(shown.x0, shown.y0), Imath::V2i(shown.x1, shown.y1)), box);
    const int width = data.x1 - data.x0 + 1, height = data.y1 - data.y0 + 1;
    std::vector<float> samples(static_cast<std::size_t>(width * height), 1e-3f);
    samples[static_cast<std::size_t>((y - data.y0) * width + x - data.x0)] = 1;
    Imf::FrameBuffer buffer;
    for (const char* channel : {"Y", also}) {
        if (channel == nullptr) continue;
        header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
        buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, samples.data(), box, sizeof(float),
                                                sizeof(float) * static_cast<std::size_t>(width)));
    }
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(height);
}

TEST(ImageDeclarations, MiddleOfAnExrIsThatOfItsDisplayWindow) {
    const MemoryFolder folder;
    write_exr(folder / "p.exr", {0, 0, 14, 14}, {3, 6, 12, 10}, 7, 7);
    const auto image = read_point_spread_image(folder / "p.exr");
    ASSERT_TRUE(image) << image.error().text();
    EXPECT_EQ((*image)->width, 10);
    EXPECT_EQ((*image)->height, 5);
    EXPECT_EQ((*image)->centre_x, 4);
    EXPECT_EQ((*image)->centre_y, 1);
    EXPECT_EQ(std::ranges::max_element((*image)->samples) - (*image)->samples.begin(), 1 * 10 + 4);
    std::vector<std::string> warnings;
    write_exr(folder / "z.exr", {0, 0, 4, 4}, {0, 0, 4, 4}, 2, 2, "Z");
    ASSERT_TRUE(read_point_spread_image(folder / "z.exr", &warnings));
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_HAS(warnings[0], "z.exr: only its channel Y is used, not Z");
    write_exr(folder / "colour.exr", {0, 0, 4, 4}, {0, 0, 4, 4}, 2, 2, "RY");
    EXPECT_FALSE(read_point_spread_image(folder / "colour.exr"));
}

TEST(ImageDeclarations, PointSpreadsUseThemToo) {
    const MemoryFolder folder;
    const Code code = [](int x, int, int) { return std::bit_cast<std::uint32_t>(x == 0 ? 3e-6f : 1e-6f); };
    folder.write("float.tif", TiffFile{.bits = 32, .format = 3}.bytes(code));
    folder.write("white.tif", TiffFile{.bits = 16, .photometric = 0}.bytes(
                                  [](int x, int, int) { return x == 0 ? 65535u - 3 : 65534u; }));
    folder.write("grey.pgm", pnm("P5 2 1 4095\n", 2, {3, 1}));
    for (const char* name : {"float.tif", "white.tif", "grey.pgm"}) {
        const auto image = read_point_spread_image(folder / name);
        ASSERT_TRUE(image) << image.error().text();
        EXPECT_NEAR((*image)->samples[0], 0.75, 1e-6) << name;
    }
}

TEST(ImageDeclarations, WarningsReachTheScene) {
    const MemoryFolder folder;
    folder.write("q.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n");
    folder.write("t.png", png_with(cv::Mat(1, 1, CV_8UC1, cv::Scalar(128)), gama(1)));
    write_exr(folder / "p.exr", {0, 0, 4, 4}, {0, 0, 4, 4}, 2, 2, "Z");
    const auto scene = read_scene(folder.write(
        "s.toml",
        "[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nmesh = \"q.obj\"\n"
        "material = {kind = \"lambert\", texture = {file = \"t.png\", colour = \"srgb\"}}\n"
        "[[camera]]\nname = \"c\"\nresolution = [64, 48]\nfov_diagonal_deg = 30\npsf = {image = \"p.exr\"}\n"));
    ASSERT_TRUE(scene) << scene.error().text();
    std::string all;
    for (const std::string& w : scene->warnings) all += w + "\n";
    EXPECT_HAS(all, "t.png: it declares linear light, and is read as sRGB");
    EXPECT_HAS(all, "p.exr: only its channel Y is used, not Z");
}

/// Random declarations, and the value of each sample that follows from them.
class ImageTrial {
public:
    explicit ImageTrial(unsigned seed) : random_(seed), width_(number(1, 20)), height_(number(1, 20)) {}

    void tiff() {
        static constexpr std::array kBits{1, 2, 4, 8, 10, 12, 14, 16, 32, 32, 64};
        const int kind = number(0, 10);
        TiffFile f{.width = width_, .height = height_, .bits = kBits[static_cast<std::size_t>(kind)]};
        f.format = kind >= 9 ? 3 : number(0, 5) == 0 ? 4 : 1;
        f.photometric = number(0, 2);
        f.bands = f.photometric == 2 ? number(3, 5) : number(1, 2);
        const int colours = f.photometric == 2 ? 3 : 1;
        for (int i = colours; i < f.bands; ++i) f.extra.push_back(i == colours ? 2 : 0);
        f.planes = number(1, 2), f.rows_per_strip = number(1, height_), f.tile = number(0, 3) == 0 ? 16 : 0;
        f.is_bigtiff = number(0, 1) != 0, f.is_big_endian = number(0, 1) != 0;
        largest_ = f.format == 3 ? 1 : std::pow(2.0, f.bits) - 1;
        fill(f.bands, f.format == 3);
        const auto code = [&](int x, int y, int band) -> std::uint64_t {
            const double v = at(x, y, band);
            if (f.format != 3) return static_cast<std::uint64_t>(v);
            return f.bits == 64 ? std::bit_cast<std::uint64_t>(v)
                                : std::bit_cast<std::uint32_t>(static_cast<float>(v));
        };
        const std::string words = fmt::format(
            "TIFF of {} x {}, {} bits, format {}, photometric {}, {} bands, planes {}, tile {}, big {} {}", width_,
            height_, f.bits, f.format, f.photometric, f.bands, f.planes, f.tile, f.is_bigtiff, f.is_big_endian);
        compare(f.bytes(code), colours, f.photometric == 0, words);
    }
    void netpbm() {
        const int largest = number(0, 1) != 0 ? number(1, 255) : number(256, 65535), kind = number(0, 4);
        largest_ = largest;
        const int colours = kind % 2 == 0 ? 1 : 3, depth = colours + (kind >= 3 ? number(0, 1) : 0),
                  size = largest > 255 ? 2 : 1;
        fill(depth, false);
        std::string head = fmt::format("P{}\n{} {}\n{}\n",
                                       kind == 4      ? 2
                                       : colours == 1 ? 5
                                                      : 6,
                                       width_, height_, largest);
        if (kind >= 3 && !(kind == 4 && depth == 1))
            head = fmt::format("P7\nWIDTH {}\nHEIGHT {}\nDEPTH {}\nMAXVAL {}\nTUPLTYPE {}{}\nENDHDR\n", width_,
                               height_, depth, largest, colours == 1 ? "GRAYSCALE" : "RGB",
                               depth > colours ? "_ALPHA" : "");
        const bool is_text = head.starts_with("P2");
        std::string body;
        for (const double v : samples_)
            body += is_text ? fmt::format("{} ", v) : bytes_of(static_cast<std::uint64_t>(v), size, true);
        compare(head + body, colours, false, head);
    }
    void png() {
        const bool has_16_bits = number(0, 1) != 0;
        largest_ = has_16_bits ? 65535 : 255;
        const double gamma = 0.01 * number(20, 200);
        fill(1, false);
        cv::Mat image(height_, width_, has_16_bits ? CV_16UC1 : CV_8UC1);
        for (int i = 0; i < width_ * height_; ++i) {
            const double v = samples_[static_cast<std::size_t>(i)];
            if (has_16_bits)
                image.at<std::uint16_t>(i / width_, i % width_) = static_cast<std::uint16_t>(v);
            else
                image.at<std::uint8_t>(i / width_, i % width_) = static_cast<std::uint8_t>(v);
        }
        compare(png_with(image, gama(gamma)), 1, false, fmt::format("PNG of gamma {}", gamma), 1 / gamma,
                Colour::by_depth);
    }
    void exr(const MemoryFolder& folder) {
        const Window shown{number(-9, 9), number(-9, 9), number(10, 25), number(10, 25)};
        Window data{number(-9, 9), number(-9, 9), number(10, 25), number(10, 25)};
        const int x = number(data.x0, data.x1), y = number(data.y0, data.y1);
        write_exr(folder / "p.exr", shown, data, x, y);
        const auto image = read_point_spread_image(folder / "p.exr");
        ASSERT_TRUE(image) << image.error().text();
        const auto head = std::ranges::max_element((*image)->samples) - (*image)->samples.begin();
        EXPECT_EQ(static_cast<double>(head % (*image)->width) - (*image)->centre_x,
                  x - 0.5 * (shown.x0 + shown.x1));
        EXPECT_EQ(static_cast<double>(head / (*image)->width) - (*image)->centre_y,
                  y - 0.5 * (shown.y0 + shown.y1));
    }

private:
    int number(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

    void fill(int bands, bool is_real) {
        bands_ = bands;
        std::uniform_real_distribution<double> part(0, 1);
        for (int i = 0; i < width_ * height_ * bands; ++i)
            samples_.push_back(is_real ? part(random_)
                                       : std::min(std::floor(part(random_) * (largest_ + 1)), largest_));
    }
    [[nodiscard]] double at(int x, int y, int band) const {
        return samples_[static_cast<std::size_t>((y * width_ + x) * bands_ + band)];
    }
    void compare(const std::string& bytes, int colours, bool is_inverted, const std::string& words,
                 double exponent = 1, Colour colour = Colour::linear) const {
        const Reading r(bytes, colour);
        ASSERT_EQ(r.error, "") << words;
        ASSERT_EQ(r.width, width_) << words;
        ASSERT_EQ(r.height, height_) << words;
        for (int i = 0; i < 3 * width_ * height_; ++i) {
            const int x = i / 3 % width_, y = i / 3 / width_;
            double value = at(x, y, colours == 3 ? i % 3 : 0) / largest_;
            if (is_inverted) value = 1 - value;
            ASSERT_NEAR(r.rgb[static_cast<std::size_t>(i)], 65535 * std::pow(value, exponent), 1)
                << words << " at " << x << ", " << y;
        }
    }

    std::mt19937 random_;
    int width_, height_, bands_ = 1;
    double largest_ = 255;
    std::vector<double> samples_;
};

TEST(ImageDeclarations, AnyDeclarationGivesItsValues) {
    const MemoryFolder folder;
    for (unsigned seed = 0; seed < static_cast<unsigned>(test::trials(200, 10'000)); ++seed) {
        SCOPED_TRACE(seed);
        ImageTrial trial(seed);
        switch (seed % 8) {
            case 0: trial.png(); break;
            case 1: trial.exr(folder); break;
            case 2:
            case 3: trial.netpbm(); break;
            default: trial.tiff(); break;
        }
        if (HasFatalFailure()) return;
    }
}

}  // namespace
}  // namespace narpa
