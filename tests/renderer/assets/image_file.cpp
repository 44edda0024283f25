// Image files, read back by libraries that others wrote.
#include "renderer/image/image_file.h"
#include "renderer/frame/camera_image.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "renderer/detector/detector.h"
#include "tests/support/image_files.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

std::string scratch(const std::string& name) {
    const auto folder = std::filesystem::path(test::build_path("image_file_test"));
    std::filesystem::create_directories(folder);
    return (folder / name).string();
}

/// A frame of a globe at the distance of the Moon from the world's origin.
struct Shot {
    Camera c = camera(12, 8, 12);
    RadianceImage image{12, 8};
    Aovs aovs;
    std::vector<std::uint8_t> bytes;

    explicit Shot(PixelFormat format) {
        c.format = format;
        const Vec3 far{3.844e8, 0.25, -1.5};
        Scene s;
        Material m = lambert(0.5f);
        m.diffuse = {0.9f, 0.5f, 0.1f};
        s.materials.push_back(m);
        add_sphere(s, 1, far);
        add_sun(s, {1, 0.2, 0.1});
        const auto render_scene = RenderScene::create(s, 1);
        EXPECT_TRUE(render_scene);
        FrameSettings settings;
        settings.spp = 2;
        render_radiance(*render_scene, placed(s), c, looking(far + Vec3{4, 1, 1}, far), settings, image, &aovs);
        bytes.resize(frame_bytes({12, 8, format, 0}));
        expose(c, image, 0, 0, bytes);
    }
    [[nodiscard]] RenderedFrame frame() const { return {c, image, &aovs, bytes}; }
};

TEST(ImageFile, ExrHoldsEveryChannelExactly) {
    const Shot shot(PixelFormat::rgb24);
    const std::string path = scratch("all.exr");
    const auto written = write_image(path, shot.frame());
    ASSERT_TRUE(written) << written.error().text();

    Imf::InputFile file(path.c_str());
    const auto plane = [&](const std::string& name) {
        std::vector<float> values(12 * 8, -77);
        EXPECT_NE(file.header().channels().findChannel(name), nullptr) << name;
        Imf::FrameBuffer buffer;
        buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), 4, 4 * 12));
        file.setFrameBuffer(buffer);
        file.readPixels(0, 7);
        return values;
    };
    const auto red = plane("R"), blue = plane("B"), body = plane("body"), variance = plane("variance"),
               albedo = plane("albedo.G");
    const auto range = plane("range"), range_rest = plane("range.rest"), depth = plane("depth.Z");
    const auto x = plane("position.X"), x_rest = plane("position.X.rest"), nz = plane("normal.Z");
    int seen = 0;
    for (std::size_t i = 0; i < red.size(); ++i) {
        EXPECT_EQ(red[i], shot.image.pixels[i].x);
        EXPECT_EQ(blue[i], shot.image.pixels[i].z);
        EXPECT_EQ(body[i], static_cast<float>(shot.aovs.body[i]));
        EXPECT_EQ(variance[i], shot.aovs.variance[i]);
        EXPECT_EQ(albedo[i], shot.aovs.body[i] < 0 ? 0 : 0.5f);
        EXPECT_EQ(nz[i], static_cast<float>(shot.aovs.normal[i].z));
        EXPECT_EQ(depth[i], static_cast<float>(shot.aovs.depth_m[i]));
        if (shot.aovs.body[i] < 0) {
            EXPECT_TRUE(std::isinf(range[i]));
            EXPECT_EQ(range_rest[i], 0);
            continue;
        }
        ++seen;
        EXPECT_NEAR(static_cast<double>(range[i]) + static_cast<double>(range_rest[i]), shot.aovs.range_m[i],
                    1e-12);
        EXPECT_NEAR(static_cast<double>(x[i]) + static_cast<double>(x_rest[i]), shot.aovs.position[i].x, 1e-6);
    }
    EXPECT_GT(seen, 10);
}

TEST(ImageFile, ExrWithoutAovsHasTheRadianceAlone) {
    const Shot shot(PixelFormat::grey);
    const std::string path = scratch("radiance.EXR");
    ASSERT_TRUE(write_image(path, {shot.c, shot.image, nullptr, {}}));
    Imf::InputFile file(path.c_str());
    int channels = 0;
    for (auto i = file.header().channels().begin(); i != file.header().channels().end(); ++i) ++channels;
    EXPECT_EQ(channels, 3);
}

TEST(ImageFile, PfmIsReadByOpenCv) {
    const Shot shot(PixelFormat::grey);
    const std::string path = scratch("radiance.pfm");
    ASSERT_TRUE(write_image(path, {shot.c, shot.image, nullptr, {}}));
    EXPECT_EQ(read_text(path).substr(0, 13), "PF\n12 8\n-1.0\n");
    const cv::Mat image = test::read_image_file(path);
    ASSERT_EQ(image.type(), CV_32FC3);
    for (int y = 0; y < 8; ++y)
        for (int x = 0; x < 12; ++x) {
            const auto bgr = image.at<cv::Vec3f>(y, x);
            const Rgb& p = shot.image.pixels[static_cast<std::size_t>(y * 12 + x)];
            EXPECT_EQ((Rgb{bgr[2], bgr[1], bgr[0]}), p);
        }
}

TEST(ImageFile, GreyPfmIsReadByOpenCv) {
    const std::string path = scratch("depth.pfm");
    const std::vector<double> values{1.5, -2, 3, NAN, 1e6, 0.25};
    ASSERT_TRUE(write_pfm(path, 3, 2, values));
    const cv::Mat image = test::read_image_file(path);
    ASSERT_EQ(image.type(), CV_32FC1);
    ASSERT_EQ(image.size(), cv::Size(3, 2));
    for (int i = 0; i < 6; ++i) {
        const double value = values[static_cast<std::size_t>(i)],
                     read = static_cast<double>(image.at<float>(i / 3, i % 3));
        EXPECT_TRUE(std::isnan(value) ? std::isnan(read) : read == value) << i;
    }
    EXPECT_FALSE(write_pfm("/nowhere/at/all.pfm", 3, 2, values));
}

TEST(ImageFile, PngIsTheCamerasOwnOutput) {
    for (const PixelFormat format : {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24, PixelFormat::yuyv,
                                     PixelFormat::gbrg8, PixelFormat::rggb16}) {
        const Shot shot(format);
        const std::string path = scratch(std::string(name(format)) + ".png");
        const auto written = write_image(path, shot.frame());
        ASSERT_TRUE(written) << written.error().text();
        const cv::Mat image = test::read_image_file(path);
        ASSERT_EQ(image.rows, 8);
        ASSERT_EQ(image.cols, 12);
        int lit = 0;
        for (int i = 0; i < 96; ++i) {
            const std::size_t at = static_cast<std::size_t>(i);
            if (bytes_per_pixel(format) == 1) {
                ASSERT_EQ(image.type(), CV_8UC1);
                EXPECT_EQ(image.at<std::uint8_t>(i), shot.bytes[at]);
            } else if (is_16_bit(format)) {
                ASSERT_EQ(image.type(), CV_16UC1);
                EXPECT_EQ(image.at<std::uint16_t>(i), shot.bytes[2 * at] | shot.bytes[2 * at + 1] << 8);
            } else {
                ASSERT_EQ(image.type(), CV_8UC3);
                const auto bgr = image.at<cv::Vec3b>(i / 12, i % 12);
                lit += bgr[2] > bgr[0];  // the globe is more red than blue
                for (int k = 0; k < 3 && format == PixelFormat::rgb24; ++k)
                    EXPECT_EQ(bgr[2 - k], shot.bytes[3 * at + static_cast<std::size_t>(k)]);
            }
        }
        EXPECT_EQ(lit > 10, image.channels() == 3);
    }
}

TEST(ImageFile, RawIsTheBytesAsTheyAre) {
    const Shot shot(PixelFormat::yuyv);
    const std::string path = scratch("frame.raw");
    ASSERT_TRUE(write_image(path, shot.frame()));
    const std::string read = read_text(path);
    EXPECT_TRUE(std::equal(read.begin(), read.end(), shot.bytes.begin(), shot.bytes.end(),
                           [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; }));
}

TEST(ImageFile, FramesAreReadAsTheyWereWritten) {
    for (const PixelFormat format : {PixelFormat::grey, PixelFormat::y16, PixelFormat::rgb24, PixelFormat::yuyv,
                                     PixelFormat::gbrg8, PixelFormat::rggb16}) {
        const Shot shot(format);
        for (const std::string extension : {".png", ".raw"}) {
            if (format == PixelFormat::yuyv && extension == ".png") continue;
            const std::string path = scratch(std::string(name(format)) + "-again" + extension);
            ASSERT_TRUE(write_image(path, shot.frame()));
            const auto read = read_frame(path, shot.c);
            ASSERT_TRUE(read) << read.error().text();
            EXPECT_EQ(*read, shot.bytes) << path;
        }
    }
    const Shot shot(PixelFormat::y16);
    const cv::Mat same(8, 12, CV_16UC1, const_cast<std::uint8_t*>(shot.bytes.data()));
    for (const char* file : {"frame.tif", "frame.pgm"}) {
        test::write_image_file(scratch(file), same);
        const auto read = read_frame(scratch(file), shot.c);
        ASSERT_TRUE(read) << read.error().text();
        EXPECT_EQ(*read, shot.bytes) << file;
    }
}

TEST(ImageFile, FramesThatAreNotTheCamerasAreRefused) {
    const auto refusal = [](const std::string& file, PixelFormat format) {
        const Shot shot(format);
        const auto read = read_frame(scratch(file), shot.c);
        EXPECT_FALSE(read) << file;
        EXPECT_EQ(read ? "" : read.error().file, scratch(file));
        return read ? std::string() : read.error().what;
    };
    test::write_image_file(scratch("wide.png"), cv::Mat::zeros(8, 13, CV_8UC1));
    test::write_image_file(scratch("colour.png"), cv::Mat::zeros(8, 12, CV_8UC3));
    test::write_image_file(scratch("grey.png"), cv::Mat::zeros(8, 12, CV_8UC1));
    std::ofstream(scratch("words.png")) << "this is no image";
    std::ofstream(scratch("empty.png")) << "";
    EXPECT_EQ(refusal("wide.png", PixelFormat::grey), "is 13 x 8, expected 12 x 8 as camera \"camera\" has");
    EXPECT_EQ(refusal("colour.png", PixelFormat::grey),
              "is colour of 8 bits, expected grey of 8 bits: camera \"camera\" is GREY");
    EXPECT_EQ(refusal("grey.png", PixelFormat::y16),
              "is grey of 8 bits, expected grey of 16 bits: camera \"camera\" is Y16");
    EXPECT_EQ(refusal("grey.png", PixelFormat::rgb24),
              "is grey of 8 bits, expected colour of 8 bits: camera \"camera\" is RGB24");
    EXPECT_EQ(refusal("grey.png", PixelFormat::yuyv),
              "camera \"camera\" is YUYV: expected the device's bytes, FILE.raw");
    test::write_image_file(scratch("alpha.png"), cv::Mat::zeros(8, 12, CV_8UC4));
    EXPECT_EQ(refusal("alpha.png", PixelFormat::rgb24),
              "is colour with alpha of 8 bits, expected colour of 8 bits: camera \"camera\" is RGB24");
    test::write_image_file(scratch("short.png"), cv::Mat::zeros(8, 12, CV_8UC1));
    std::filesystem::resize_file(scratch("short.png"), 50);
    EXPECT_EQ(refusal("short.png", PixelFormat::grey), "cannot be decoded: it is damaged, or cut short");
    Shot twelve_bits(PixelFormat::y16);
    twelve_bits.c.detector = Detector{.bits = 12};
    test::write_image_file(scratch("right.png"), cv::Mat(8, 12, CV_16UC1, cv::Scalar(4095)));
    const auto right = read_frame(scratch("right.png"), twelve_bits.c);
    ASSERT_FALSE(right);
    EXPECT_NE(right.error().what.find("more than the 12 bits of camera"), std::string::npos) << right.error().what;
    EXPECT_NE(refusal("words.png", PixelFormat::grey).find("no image that can be decoded"), std::string::npos);
    EXPECT_NE(refusal("empty.png", PixelFormat::grey).find("no image that can be decoded"), std::string::npos);
    EXPECT_EQ(refusal("nowhere.png", PixelFormat::grey), "no such file");
}

TEST(ImageFile, ErrorsNameTheFileAndTheReason) {
    const Shot shot(PixelFormat::grey);
    const auto jpeg = write_image(scratch("frame.jpeg"), shot.frame());
    ASSERT_FALSE(jpeg);
    EXPECT_NE(jpeg.error().text().find(".jpeg"), std::string::npos);
    EXPECT_NE(jpeg.error().text().find(".exr"), std::string::npos);
    for (const char* extension : {".exr", ".pfm", ".png", ".raw"}) {
        const auto nowhere = write_image("/nonexistent-folder/frame" + std::string(extension), shot.frame());
        ASSERT_FALSE(nowhere) << extension;
        EXPECT_NE(nowhere.error().text().find("/nonexistent-folder"), std::string::npos);
        EXPECT_NE(nowhere.error().what.find("No such file"), std::string::npos) << nowhere.error().what;
    }
    const auto no_bytes = write_image(scratch("frame.png"), {shot.c, shot.image, nullptr, {}});
    EXPECT_FALSE(no_bytes);
    if (std::filesystem::exists("/dev/full")) {
        std::filesystem::remove(scratch("full.raw"));
        std::filesystem::create_symlink("/dev/full", scratch("full.raw"));
        EXPECT_FALSE(write_image(scratch("full.raw"), shot.frame()));
    }
}

}  // namespace
}  // namespace narpa
