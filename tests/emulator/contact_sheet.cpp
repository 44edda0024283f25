#include "emulator/log/contact_sheet.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

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
    for (const PixelFormat pixel : {PixelFormat::grey, PixelFormat::y16, PixelFormat::yuyv, PixelFormat::rgb24}) {
        const VideoFormat format{64, 48, pixel};
        const std::vector<std::uint8_t> frame(frame_bytes(format), 100);
        for (const int frames : {1, 5, 24, 25, 1000}) {
            ContactSheet sheet(format);
            for (int k = 0; k < frames; ++k) sheet.offer(static_cast<std::uint64_t>(k), frame);
            const std::string path = folder / "sheet.png";
            ASSERT_TRUE(sheet.write(path));
            const int tiles = frames <= 24 ? frames : frames == 25 ? 13 : 16;  // 1000 frames: stride 64
            const auto [w, h] = png_size(path);
            EXPECT_EQ(w, std::min(6, tiles) * 68 + 4) << frames;
            EXPECT_EQ(h, (tiles + 5) / 6 * 52 + 4) << frames;
        }
    }
}

TEST(ContactSheet, ErrorNamesTheFile) {
    ContactSheet sheet({8, 8, PixelFormat::grey});
    EXPECT_TRUE(sheet.write("/nowhere/at/all.png"));  // nothing taken, nothing to write
    sheet.offer(0, std::vector<std::uint8_t>(64));
    const Status status = sheet.write("/nowhere/at/all.png");
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().file, "/nowhere/at/all.png");
}

}  // namespace
}  // namespace narpa
