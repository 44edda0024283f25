// Vignetting, point spread and veiling glare against their formulas.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <complex>
#include <numbers>

#include "renderer/camera/scene_camera.h"
#include "renderer/optics/image_optics.h"
#include "renderer/optics/veiling_glare.h"
#include "renderer/optics/vignetting.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/optics/point_spread_support.h"

namespace narpa {
namespace {

using namespace test;
using std::numbers::pi;

double sinc(double x) {
    return x == 0 ? 1 : std::sin(pi * x) / (pi * x);
}

constexpr double kSlant_rad = 0.09;

/// An edge of a glowing plate, 5 degrees off the columns, through the middle of the image.
RadianceImage slanted_edge(const Camera& c) {
    Scene scene;
    Material glow = lambert(0);
    glow.emission = {1, 1, 1};
    scene.materials.push_back(glow);
    Mesh half = plate(20, 20);
    for (Vec3f& p : half.positions) p.x += 10;
    add_mesh(scene, half);
    // From the front: x of the plate is to the right of the image, y up.
    const Rigid3 T_world_camera{exp_rotation({0, 0, kSlant_rad}) * Quat{0, 1, 0, 0}, {0, 0, 5}};
    return rendered(scene, c, T_world_camera, {.spp = 256});
}

/// The modulation transfer at so many cycles a pixel across the edge, after ISO 12233: the edge profile in bins of
/// a tenth of a pixel, its derivative, its Fourier transform.
double modulation(const RadianceImage& image, double f) {
    constexpr double kPerPixel = 10, kReach = 16;
    constexpr int kBins = static_cast<int>(2 * kReach * kPerPixel);
    std::vector<double> sum(kBins), n(kBins);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double across = (x - (image.width - 1) / 2.0) * std::cos(kSlant_rad) +
                                  (y - (image.height - 1) / 2.0) * std::sin(kSlant_rad);
            const int bin = static_cast<int>(std::floor((across + kReach) * kPerPixel));
            if (bin < 0 || bin >= kBins) continue;
            const auto b = static_cast<std::size_t>(bin);
            sum[b] += static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y), ++n[b];
        }
    std::complex<double> transform = 0, at_zero = 0;
    for (std::size_t b = 1; b < kBins; ++b) {
        const double step = sum[b] / n[b] - sum[b - 1] / n[b - 1];
        transform += step * std::polar(1.0, -2 * pi * f * static_cast<double>(b) / kPerPixel);
        at_zero += step;
    }
    return std::abs(transform / at_zero) / sinc(f / kPerPixel);  // the bins' own width
}

void expect_transfer(const std::optional<PointSpreadFunction>& spread) {
    Camera c = camera(129, 129, 100);
    c.optics.point_spread = spread;
    const RadianceImage image = slanted_edge(c);
    for (double f = 0.05; f < 0.46; f += 0.05) {
        const double pixel = sinc(f * std::cos(kSlant_rad)) * sinc(f * std::sin(kSlant_rad));
        const double lens =
            spread ? std::abs(transfer(*spread, f * std::cos(kSlant_rad), f * std::sin(kSlant_rad))) : 1;
        EXPECT_NEAR(modulation(image, f), pixel * lens, 0.02) << "at " << f << " cycles a pixel";
    }
}

TEST(PointSpreadFunction, SlantedEdgeHasTheTransferOfThePixelAlone) {
    expect_transfer(std::nullopt);
}
TEST(PointSpreadFunction, SlantedEdgeHasTheTransferOfTheGaussian) {
    for (const double sigma_px : {0.4, 0.7, 1.5}) expect_transfer(PointSpreadFunction{.sigma_px = sigma_px});
}
TEST(PointSpreadFunction, SlantedEdgeHasTheTransferOfTheAperture) {
    // f/4 at 550 nm: 5 and 1.5 um pixels.
    for (const double pitch_m : {5e-6, 1.5e-6})
        expect_transfer(PointSpreadFunction{.cutoff_per_px = pitch_m / (550e-9 * 4)});
}

/// Of the filter itself, over all frequencies and many spreads, where the edges above sample a few.
TEST(PointSpreadFunction, FilterHasTheTransferUpToHalfACycle) {
    std::vector<PointSpreadFunction> spreads;
    for (double sigma_px = 0.1; sigma_px <= 8; sigma_px *= 1.2) spreads.push_back({.sigma_px = sigma_px});
    for (double cutoff = 0.1; cutoff < 20; cutoff *= 1.2) spreads.push_back({.cutoff_per_px = cutoff});
    for (double cutoff = 0.1; cutoff < 20; cutoff *= 2)
        spreads.push_back({.sigma_px = 0.7, .cutoff_per_px = cutoff});
    for (const PointSpreadFunction& spread : spreads) {
        // A slow aperture's faint rings reach beyond the widest filter: 2 % at a cutoff of 0.175.
        const bool slow = spread.cutoff_per_px > 0 && spread.cutoff_per_px < 0.35;
        EXPECT_LT(worst_transfer_error(spread), slow ? 0.0035 / spread.cutoff_per_px : 0.01)
            << spread.sigma_px << " px, " << spread.cutoff_per_px << " cycles/px";
    }
}

TEST(PointSpreadFunction, KeepsTheLightOfAPoint) {
    for (const PointSpreadFunction& spread :
         {PointSpreadFunction{.sigma_px = 0.8}, PointSpreadFunction{.sigma_px = 0.5, .cutoff_per_px = 0.7}}) {
        Camera c = camera(101, 101, 100);
        c.optics.point_spread = spread;
        ImageOptics optics(c.optics, c.plane());
        RadianceImage in(101, 101), out(101, 101);
        in.pixels[50 * 101 + 40] = {1, 2, 3};
        optics.apply(in, out);
        Vec3 sum, x, y;
        for (int j = 0; j < 101; ++j)
            for (int i = 0; i < 101; ++i) {
                const Vec3 v = vec_cast<double>(out.pixels[static_cast<std::size_t>(j * 101 + i)]);
                sum = sum + v, x = x + i * v, y = y + j * v;
            }
        EXPECT_NEAR(sum.x, 1, 1e-5);
        EXPECT_NEAR(sum.z, 3, 3e-5);
        EXPECT_NEAR(x.y / sum.y, 40, 1e-4);
        EXPECT_NEAR(y.y / sum.y, 50, 1e-4);
    }
}

TEST(PointSpreadFunction, AFlatImageStaysFlatUpToItsBorder) {
    Camera c = camera(40, 30, 100);
    c.optics.point_spread = PointSpreadFunction{.sigma_px = 0.5, .cutoff_per_px = 0.7};
    ImageOptics optics(c.optics, c.plane());
    RadianceImage in(40, 30), out(40, 30);
    std::ranges::fill(in.pixels, Rgb{2, 2, 2});
    optics.apply(in, out);
    for (const Rgb& v : out.pixels) EXPECT_NEAR(v.x, 2, 1e-5);
}

/// The sum of the filter's products, pixel by pixel; beyond the image its border is repeated.
RadianceImage convolution(const SeparableFilter& filter, const RadianceImage& in) {
    RadianceImage out(in.width, in.height);
    const int r = filter.radius;
    for (int y = 0; y < in.height; ++y)
        for (int x = 0; x < in.width; ++x) {
            Vec3 sum;
            for (int j = -r; j <= r; ++j)
                for (int i = -r; i <= r; ++i) {
                    double weight = 0;
                    for (const auto& term : filter.terms)
                        weight += static_cast<double>(term.column[static_cast<std::size_t>(r + j)]) *
                                  static_cast<double>(term.row[static_cast<std::size_t>(r + i)]);
                    const int px = std::clamp(x - i, 0, in.width - 1), py = std::clamp(y - j, 0, in.height - 1);
                    sum = sum + weight * vec_cast<double>(in.pixels[static_cast<std::size_t>(py * in.width + px)]);
                }
            out.pixels[static_cast<std::size_t>(y * in.width + x)] = vec_cast<float>(sum);
        }
    return out;
}

TEST(PointSpreadFunction, IsTheConvolutionOfEachImageWithItsFilter) {
    PointSpreadImage comet{.width = 5, .height = 3, .centre_x = 1, .centre_y = 1, .samples = {}};
    comet.samples = {0, 0.1, 0, 0, 0, 0.1, 0.4, 0.2, 0.1, 0, 0, 0, 0.1, 0, 0};
    for (const PointSpreadFunction& spread :
         {PointSpreadFunction{.cutoff_per_px = 1.1},
          PointSpreadFunction{.image = std::make_shared<const PointSpreadImage>(comet)}}) {
        Camera c = camera(150, 40, 100);
        c.optics.point_spread = spread;
        ImageOptics optics(c.optics, c.plane());
        // Light at one corner, in the middle, at the other corner, and nowhere: what was lit is dark again.
        for (const auto& [left, top] :
             {std::pair(0, 0), std::pair(70, 18), std::pair(146, 36), std::pair(150, 40)}) {
            RadianceImage in(150, 40), out(150, 40);
            for (int y = top; y < std::min(top + 4, 40); ++y)
                for (int x = left; x < std::min(left + 4, 150); ++x)
                    in.pixels[static_cast<std::size_t>(y * 150 + x)] = {1.0f + static_cast<float>(x % 3), 2, 0.5f};
            optics.apply(in, out);
            const RadianceImage wanted = convolution(filter_of(spread), in);
            for (std::size_t i = 0; i < out.pixels.size(); ++i)
                ASSERT_LT(norm(out.pixels[i] - wanted.pixels[i]), 2e-6f) << left << ": pixel " << i;
        }
    }
}

TEST(PointSpreadFunction, IsTheSameOnAnyNumberOfThreads) {
    Camera c = camera(65, 50, 100);
    c.optics.point_spread = PointSpreadFunction{.cutoff_per_px = 0.5};
    c.optics.effects = {veiling_glare(0.1)};
    RadianceImage in(65, 50), one(65, 50), many(65, 50);
    for (std::size_t i = 0; i < in.pixels.size(); i += 7) in.pixels[i] = {static_cast<float>(i), 1, 0};
    ImageOptics optics(c.optics, c.plane());
    optics.apply(in, many);
    optics.add_effects({CameraPose{}}, many);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    optics.apply(in, one);
    optics.add_effects({CameraPose{}}, one);
    EXPECT_EQ(one.pixels, many.pixels);
}

TEST(Vignetting, FallsWithCosFourAndThePolynomial) {
    Camera c = camera(160, 120, 80);
    c.optics.effects = {vignetting({.cos4 = true, .polynomial = {-0.1, 0.02, 0}})};
    ImageOptics optics(c.optics, c.plane());
    RadianceImage in(160, 120), out(160, 120);
    std::ranges::fill(in.pixels, Rgb{1, 1, 1});
    optics.apply(in, out);
    for (const auto& [x, y] : {std::pair(80, 60), std::pair(0, 0), std::pair(159, 30), std::pair(120, 119)}) {
        const double theta = std::acos(c.model->direction({static_cast<double>(x), static_cast<double>(y)}).z);
        const double s = theta * theta, wanted = std::pow(std::cos(theta), 4) * (1 - 0.1 * s + 0.02 * s * s);
        EXPECT_NEAR(out.pixels[static_cast<std::size_t>(y * 160 + x)].y, wanted, 1e-6);
    }
}

TEST(VeilingGlare, SpreadsItsShareEvenly) {
    Camera c = camera(20, 10, 100);
    c.optics.effects = {veiling_glare(0.05)};
    ImageOptics optics(c.optics, c.plane());
    RadianceImage in(20, 10), out(20, 10);
    in.pixels[33] = {100, 0, 0};
    optics.apply(in, out);
    optics.add_effects({CameraPose{}}, out);
    EXPECT_NEAR(out.pixels[0].x, 0.05 * 100 / 200, 1e-6);
    EXPECT_NEAR(out.pixels[33].x, 95 + 0.05 * 100 / 200, 1e-4);
}

}  // namespace
}  // namespace narpa
