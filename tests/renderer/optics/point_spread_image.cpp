// The point spread of a lens from an image: the same filter as a formula's where the image has samples of it.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <gtest/gtest.h>

#include <functional>

#include "renderer/assets/images/point_spread_file.h"
#include "renderer/optics/image_optics.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/optics/point_spread_support.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/image_files.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// Light at (x, y) pixels from the centre of a `size` x `size` image.
using LightAt = std::function<double(double x, double y)>;

LightAt gaussian(double sigma_px) {
    return [=](double x, double y) { return std::exp(-0.5 * (x * x + y * y) / (sigma_px * sigma_px)); };
}

/// A head with a wider, fainter tail to its right and below.
double coma(double x, double y) {
    return gaussian(0.8)(x, y) + 0.3 * gaussian(1.5)(x - 2, y - 1) + 0.1 * gaussian(2)(x - 5, y - 2.5);
}

PointSpreadFunction image_of(const LightAt& spread, int size, double samples_per_px) {
    auto image = std::make_shared<PointSpreadImage>();
    image->width = image->height = size;
    image->centre_x = image->centre_y = 0.5 * (size - 1);
    double sum = 0;
    for (int j = 0; j < size; ++j)
        for (int i = 0; i < size; ++i) {
            image->samples.push_back(
                spread((i - image->centre_x) / samples_per_px, (j - image->centre_y) / samples_per_px));
            sum += image->samples.back();
        }
    for (double& sample : image->samples) sample /= sum;
    return {.image = image, .samples_per_px = samples_per_px};
}

double weight_at(const SeparableFilter& filter, int x, int y) {
    if (std::max(std::abs(x), std::abs(y)) > filter.radius) return 0;
    double sum = 0;
    for (const auto& [column, row] : filter.terms)
        sum += static_cast<double>(column[static_cast<std::size_t>(filter.radius + y)]) *
               static_cast<double>(row[static_cast<std::size_t>(filter.radius + x)]);
    return sum;
}

TEST(PointSpreadImage, SamplesOfAGaussianGiveItsFilter) {
    struct Case {
        double sigma_px, samples_per_px;
        int size;
    };
    for (const auto& [sigma_px, samples_per_px, size] :
         {Case{1.5, 1, 15}, Case{1.5, 1, 16}, Case{0.8, 2, 17}, Case{0.8, 4, 32}, Case{0.8, 2.5, 22}}) {
        const SeparableFilter one = filter_of({.sigma_px = sigma_px});
        const SeparableFilter other = filter_of(image_of(gaussian(sigma_px), size, samples_per_px));
        for (int y = -kPointSpreadReach_px; y <= kPointSpreadReach_px; ++y)
            for (int x = -kPointSpreadReach_px; x <= kPointSpreadReach_px; ++x)
                EXPECT_NEAR(weight_at(one, x, y), weight_at(other, x, y), 5e-4)
                    << sigma_px << " px, " << samples_per_px << " samples/px, at " << x << ", " << y;
    }
}

TEST(PointSpreadImage, FilterHasTheTransferOfTheImage) {
    for (const double samples_per_px : {1.0, 2.0, 3.0}) {
        const int size = static_cast<int>(24 * samples_per_px);
        EXPECT_LT(worst_transfer_error(image_of(coma, size, samples_per_px)), 0.011);
        EXPECT_LT(worst_transfer_error(image_of(coma, size + 1, samples_per_px)), 0.011);
    }
}

TEST(PointSpreadImage, TransferOfAGaussianIsItsFormula) {
    const PointSpreadFunction image = image_of(gaussian(0.8), 33, 4), formula{.sigma_px = 0.8};
    for (double fx = -0.7; fx <= 0.7; fx += 0.1)
        for (double fy = 0; fy <= 0.7; fy += 0.1)
            EXPECT_NEAR(std::abs(transfer(image, fx, fy) - transfer(formula, fx, fy)), 0, 1e-5);
    EXPECT_EQ(transfer(image, 2.1, 0), 0.0);
}

/// Centroid of what a point becomes.
Vec3 centroid_of_point(const PointSpreadFunction& spread) {
    constexpr int kSize = 81, kMiddle = 40;
    Camera c = camera(kSize, kSize, 100);
    c.optics.point_spread = spread;
    RadianceImage in(kSize, kSize), out(kSize, kSize);
    in.pixels[kMiddle * kSize + kMiddle] = {1, 1, 1};
    ImageOptics(c.optics, c.plane()).apply(in, out);
    Vec3 sum;
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            const double light = static_cast<double>(out.pixels[static_cast<std::size_t>(y * kSize + x)].y);
            sum = sum + light * Vec3{static_cast<double>(x - kMiddle), static_cast<double>(y - kMiddle), 1};
        }
    EXPECT_NEAR(sum.z, 1, 1e-5);
    return sum / sum.z;
}

TEST(PointSpreadImage, AComaPullsPointsItsOwnWay) {
    // Of the three Gaussians by their volumes.
    const double head = 0.64, tail = 0.3 * 2.25, end = 0.1 * 4, all = head + tail + end;
    const double x = (2 * tail + 5 * end) / all, y = (tail + 2.5 * end) / all;
    const Vec3 at = centroid_of_point(image_of(coma, 81, 3));
    EXPECT_NEAR(at.x, x, 0.01);
    EXPECT_NEAR(at.y, y, 0.01);
}

TEST(PointSpreadImage, ItsCentreIsWhereAPinholeImagesThePoint) {
    const PointSpreadFunction spread = image_of(gaussian(1), 41, 3);
    auto image = std::make_shared<PointSpreadImage>(*spread.image);
    image->centre_x -= 4.5, image->centre_y += 1.5;
    const Vec3 at = centroid_of_point({.image = image, .samples_per_px = 3});
    EXPECT_NEAR(at.x, 1.5, 0.01);
    EXPECT_NEAR(at.y, -0.5, 0.01);
}

/// 16 bits, and as 32-bit floats in channel Y.
void write_png(const std::string& path, const PointSpreadImage& image) {
    cv::Mat1w samples(image.height, image.width);
    const double most = *std::ranges::max_element(image.samples);
    for (int i = 0; i < image.width * image.height; ++i)
        samples(i / image.width, i % image.width) =
            static_cast<std::uint16_t>(std::lround(65535 * image.samples[static_cast<std::size_t>(i)] / most));
    test::write_image_file(path, samples);
}
void write_exr(const std::string& path, const PointSpreadImage& image, const char* channel = "Y") {
    std::vector<float> samples(image.samples.begin(), image.samples.end());
    Imf::Header header(image.width, image.height);
    header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
    Imf::FrameBuffer buffer;
    buffer.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(samples.data()), sizeof(float),
                                      sizeof(float) * static_cast<std::size_t>(image.width)));
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(image.height);
}

TEST(PointSpreadImage, IsReadFromPngAndExr) {
    const MemoryFolder folder;
    const PointSpreadImage image = *image_of(coma, 24, 1).image;
    write_png(folder / "coma.png", image);
    write_exr(folder / "coma.exr", image);
    for (const char* name : {"coma.png", "coma.exr"}) {
        const auto read = read_point_spread_image(folder / name);
        ASSERT_TRUE(read) << read.error().text();
        ASSERT_EQ((*read)->width, 24);
        ASSERT_EQ((*read)->height, 24);
        EXPECT_EQ((*read)->centre_x, 11.5);
        for (std::size_t i = 0; i < image.samples.size(); ++i)
            EXPECT_NEAR((*read)->samples[i], image.samples[i], 2e-6) << name << " " << i;
    }
}

TEST(PointSpreadImage, IsRefusedWhereItIsNoPointSpread) {
    const MemoryFolder folder;
    const auto expect = [&](const char* name, const std::string& words) {
        const auto read = read_point_spread_image(folder / name);
        ASSERT_FALSE(read) << name;
        EXPECT_NE(read.error().text().find(words), std::string::npos) << read.error().text();
    };
    test::write_image_file(folder / "colour.png", cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3)));
    test::write_image_file(folder / "large.png", cv::Mat(4, 300, CV_8UC1, cv::Scalar(1)));
    test::write_image_file(folder / "black.png", cv::Mat(4, 4, CV_8UC1, cv::Scalar(0)));
    PointSpreadImage image{.width = 2, .height = 1, .samples = {1, -1}};
    write_exr(folder / "below.exr", image);
    write_exr(folder / "band.exr", image, "R");
    folder.write("noise.exr", "\x76\x2f\x31\x01 and nothing else");
    expect("colour.png", "expected one band (grey)");
    expect("large.png", "an image of 300 x 4 samples, expected at most 256 x 256");
    expect("black.png", "all samples are 0");
    expect("below.exr", "a sample of -1, expected light");
    expect("band.exr", "has no channel Y");
    expect("noise.exr", "image cannot be decoded");
    expect("none.png", "no such file");
}

constexpr const char* kScene =
    "[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n"
    "[[camera]]\nname = \"c\"\nresolution = [64, 48]\nfov_diagonal_deg = 30\n";

TEST(PointSpreadImage, IsNamedRelativeToTheScene) {
    const MemoryFolder folder;
    write_png(folder / "coma.png", *image_of(coma, 24, 1).image);
    const auto scene =
        read_scene(folder.write("s.toml", kScene + std::string("psf = {image = \"coma.png\", samples_per_px = 2, "
                                                               "centre = [3, 4]}\n")));
    ASSERT_TRUE(scene) << scene.error().text();
    const auto& spread = scene->cameras[0].optics.point_spread;
    ASSERT_TRUE(spread && spread->image);
    EXPECT_EQ(spread->samples_per_px, 2);
    EXPECT_EQ(spread->image->centre_x, 3);
    EXPECT_EQ(spread->image->centre_y, 4);
}

TEST(PointSpreadImage, ReachesNoFartherThanTheFilter) {
    const MemoryFolder folder;
    write_png(folder / "wide.png", *image_of(coma, 70, 1).image);
    const auto scene = read_scene(folder.write("s.toml", kScene + std::string("psf = {image = \"wide.png\"}\n")));
    ASSERT_FALSE(scene);
    EXPECT_NE(
        scene.error().text().find("s.toml:10:16: image: reaches 34.5 pixels from its centre, expected at most 31"),
        std::string::npos)
        << scene.error().text();
}

}  // namespace
}  // namespace narpa
