#include "emulator/log/contact_sheet.h"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <vector>

#include "tests/support/image_files.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

/// Width and height of a PNG, from its header.
std::array<int, 2> png_size(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    std::array<unsigned char, 24> h{};
    in.read(reinterpret_cast<char*>(h.data()), h.size());
    const auto be32 = [&](std::size_t i) { return h[i] << 24 | h[i + 1] << 16 | h[i + 2] << 8 | h[i + 3]; };
    return {be32(16), be32(20)};
}

TEST(ContactSheet, SpreadsAnyNumberOfFramesOverAtMostTwentyFourTiles) {
    const test::TemporaryFolder folder;
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24,
                                    PixelFormat::grbg8, PixelFormat::bggr16}) {
        const VideoFormat format{64, 48, pixel};
        const std::vector<std::uint8_t> frame(frame_bytes(format), 100);
        for (const int frames : {1, 5, 24, 25, 1000}) {
            ContactSheet sheet(format);
            for (int k = 0; k < frames; ++k) sheet.offer(static_cast<std::uint64_t>(k), k, frame);
            const std::string path = folder / "sheet.png";
            ASSERT_TRUE(sheet.write(path));
            const int tiles = frames <= 24 ? frames : frames == 25 ? 13 : 16;  // 1000 frames: stride 64
            const auto [w, h] = png_size(path);
            EXPECT_EQ(w, std::min(6, tiles) * 68 + 4) << frames;
            EXPECT_EQ(h, (tiles + 5) / 6 * 52 + 4) << frames;
        }
    }
}

TEST(ContactSheet, MosaicsHaveTheirColours) {
    const test::TemporaryFolder folder;
    for (const PixelFormat pixel :
         {PixelFormat::rggb8, PixelFormat::grbg8, PixelFormat::gbrg16, PixelFormat::bggr16}) {
        const VideoFormat format{64, 48, pixel};
        std::vector<std::uint8_t> frame(frame_bytes(format));
        const std::size_t size = bytes_per_pixel(pixel);
        const std::array<std::uint8_t, 3> rgb{255, 100, 0};
        for (int y = 0; y < 48; ++y)
            for (int x = 0; x < 64; ++x)
                frame[static_cast<std::size_t>(y * 64 + x) * size + size - 1] = rgb[bayer_band(pixel, x, y)];
        ContactSheet sheet(format);
        sheet.offer(0, 0, frame);
        const std::string path = folder / "sheet.png";
        ASSERT_TRUE(sheet.write(path));
        const cv::Mat image = test::read_image_file(path);
        for (const auto& [x, y] : {std::pair{20, 10}, {21, 10}, {20, 11}, {21, 11}}) {
            const auto bgr = image.at<cv::Vec3b>(y, x);
            EXPECT_EQ(bgr[2], 255) << name(pixel);
            EXPECT_NEAR(bgr[1], 168, 2) << name(pixel) << ": 100 by the sRGB curve";
            EXPECT_EQ(bgr[0], 0) << name(pixel);
        }
    }
}

/// The sheet of one frame.
cv::Mat sheet_of(const VideoFormat& format, std::int64_t t_mid_ns, const std::vector<std::uint8_t>& frame) {
    const test::TemporaryFolder folder;
    ContactSheet sheet(format);
    sheet.offer(0, t_mid_ns, frame);
    EXPECT_TRUE(sheet.write(folder / "sheet.png"));
    return test::read_image_file(folder / "sheet.png");
}

TEST(ContactSheet, APixelReadsFourOfALargeFrame) {
    constexpr int kScale = 5, kWidth = 320 * kScale, kHeight = 20 * kScale;
    const VideoFormat format{kWidth, kHeight, PixelFormat::grey};
    int read = 0;
    for (int k = 0; k < kScale * kScale; ++k) {  // this one of all that a thumbnail's pixel stands for is white
        std::vector<std::uint8_t> frame(frame_bytes(format));
        for (int y = k / kScale; y < kHeight; y += kScale)
            for (int x = k % kScale; x < kWidth; x += kScale) frame[static_cast<std::size_t>(y * kWidth + x)] = 255;
        const int shown = sheet_of(format, 0, frame).at<cv::Vec3b>(8, 160)[0];
        read += shown > 0;
        if (shown > 0) {
            EXPECT_NEAR(shown, 136, 2) << "a quarter of white by the sRGB curve";
        }
    }
    EXPECT_EQ(read, 4);
}

TEST(ContactSheet, StatesTheTimeOfTheExposure) {
    const VideoFormat often{64, 48, PixelFormat::grey, 10'000'000},
        seldom{64, 48, PixelFormat::grey, 1'000'000'000};
    const std::vector<std::uint8_t> frame(frame_bytes(often), 100);
    const auto differs = [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b) > 0; };
    const cv::Mat at_start = sheet_of(often, 0, frame), later = sheet_of(often, 7'250'000'000, frame);
    EXPECT_TRUE(differs(at_start, later)) << "a triggered camera's first frame may be of any time";
    EXPECT_FALSE(differs(later, sheet_of(seldom, 7'250'000'000, frame)));
}

TEST(ContactSheet, ErrorNamesTheFile) {
    ContactSheet sheet({8, 8, PixelFormat::grey});
    EXPECT_TRUE(sheet.write("/nowhere/at/all.png"));  // nothing taken, nothing to write
    sheet.offer(0, 0, std::vector<std::uint8_t>(64));
    const Status status = sheet.write("/nowhere/at/all.png");
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().file, "/nowhere/at/all.png");
}

}  // namespace
}  // namespace narpa
