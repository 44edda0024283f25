// What makes photosites differ: fixed patterns and defects; and that it is fast and repeatable.
#include "renderer/detector/sensor_array.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <set>

#include "base/each_isa.h"
#include "renderer/detector/blooming.h"
#include "renderer/detector/collect.h"
#include "renderer/detector/cosmic_rays.h"
#include "renderer/detector/dark_current.h"
#include "renderer/detector/defective_pixels.h"
#include "renderer/detector/detector_stage.h"
#include "renderer/detector/nonuniformity.h"
#include "tests/renderer/detector/detector_support.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace test;

constexpr PixelFormat kArrayFormats[] = {PixelFormat::grey, PixelFormat::y16,   PixelFormat::rgb24,
                                         PixelFormat::yuyv, PixelFormat::grbg8, PixelFormat::bggr16};

Camera with_everything(int width, int height, PixelFormat format, bool moving = true) {
    Camera c = noisy_camera(width, height, format);
    Detector& d = *c.detector;
    d.temperature_c = 30;
    d.stages = {
        dark_current(500), nonuniformity({.prnu = 0.02, .dsnu_e = 4}),
        defective_pixels(
            {.dead_share = 0.01, .hot_share = 0.01, .hot_e_s = 1e5, .blinking_share = 0.01, .blinking_e_s = 1e5})};
    if (moving) d.stages.insert(d.stages.end(), {blooming(), cosmic_rays({.per_cm2_s = 1e5})});
    return c;
}
/// Sites whose electrons fulfil the condition.
template <class F>
std::set<std::size_t> sites_with(const std::vector<int>& e, const F& condition) {
    std::set<std::size_t> sites;
    for (std::size_t i = 0; i < e.size(); ++i)
        if (condition(e[i])) sites.insert(i);
    return sites;
}

constexpr TableKey kCameraRows[]{{"detector", rows::table(kDetectorKeys)}};
constexpr TableKeys kKeysOfCamera{.rows = kCameraRows};

/// The detector of a camera with this text in [camera.detector].
Detector detector_of(const std::string& text) {
    return read_table("[detector]\n" + text, kKeysOfCamera,
                      [](TableReader& camera) { return *read_detector(camera, 1'000'000'000); });
}

TEST(SensorArray, IsThereOnlyWhereTheDetectorNamesSomethingOfIt) {
    Camera c = noisy_camera(8, 8, PixelFormat::y16);
    const auto is_there = [&](const std::string& text) {
        c.detector = detector_of(text);
        return SensorArray::create(c, 1) != nullptr;
    };
    EXPECT_FALSE(is_there(""));
    EXPECT_FALSE(is_there("temperature_c = 60\ndark_doubling_c = 5\nsensitive_depth_m = 0.01"))
        << "no dark current";
    EXPECT_FALSE(is_there("prnu = 0\ndsnu_e = 0\ndead_pixel_share = 0\nblooming = false\ndark_current_e_s = 0"));
    for (const char* text :
         {"dark_current_e_s = 0.01", "prnu = 0.01", "dsnu_e = 0.01", "dead_pixel_share = 0.01",
          "hot_pixel_share = 0.01\nhot_pixel_e_s = 1", "blinking_pixel_share = 0.01\nblinking_e_s = 1",
          "cosmic_rays_per_cm2_s = 0.01", "blooming = true"})
        EXPECT_TRUE(is_there(text)) << text;
    c.detector.reset();
    EXPECT_EQ(SensorArray::create(c, 1), nullptr);
}

TEST(SensorArray, WithoutEffectGivesThePlainNumbersOfLitPixels) {
    // An array whose only stage has nothing to do: charge far below the full well.
    for (const PixelFormat format : kArrayFormats) {
        Camera c = noisy_camera(206, 88, format);
        RadianceImage image = motley(206, 88);
        for (Rgb& p : image.pixels)
            for (int b = 0; b < 3; ++b) p[b] = p[b] > 0.01f && p[b] < 2 ? p[b] : 1.0f;
        const auto plain = bytes_of(c, image);
        c.detector->stages = {blooming()};
        EXPECT_EQ(bytes_of(c, image), plain) << name(format);
        c.detector->stages = {cosmic_rays({.per_cm2_s = 1e-9})};
        EXPECT_EQ(bytes_of(c, image), plain) << name(format);
        c.detector->stages.push_back(nonuniformity({.dsnu_e = 1e-12}));
        EXPECT_EQ(bytes_of(c, image), plain) << name(format);
    }
}

TEST(SensorArray, PatternsAreTheSameInEachFrameAndOthersOnOtherCameras) {
    Camera c = counting(100, 100);
    c.detector->stages = {nonuniformity({.prnu = 0.05, .dsnu_e = 10}),
                          defective_pixels({.dead_share = 0.02, .hot_share = 0.02, .hot_e_s = 3e5})};
    RadianceImage image(100, 100);
    std::fill(image.pixels.begin(), image.pixels.end(), radiance_for(*c.detector, 5000));
    const std::vector<int> first = electrons(c, image, 0);
    EXPECT_EQ(electrons(c, image, 1), first);
    EXPECT_EQ(electrons(c, image, 1'000'000), first);
    c.name = "other";
    EXPECT_NE(electrons(c, image, 0), first);
    c.name = "counting";
    const auto array = SensorArray::create(c, 2);
    std::vector<std::uint8_t> seed_1(20000), seed_2(20000);
    expose(c, image, 1, 0, seed_1);
    expose(c, image, 1, 0, seed_2, array.get());
    EXPECT_NE(seed_1, seed_2);
}

TEST(SensorArray, DarkCurrentDoublesWithTemperature) {
    Camera c = counting(4, 4);
    c.detector->stages = {dark_current(20000)};  // 200 e- in 10 ms
    const auto dark_at = [&](double celsius) {
        c.detector->temperature_c = celsius;
        return dark_electrons_of(c)[5];
    };
    EXPECT_EQ(dark_at(20), 200);
    EXPECT_EQ(dark_at(27), 400);
    EXPECT_EQ(dark_at(13), 100);
    EXPECT_EQ(dark_at(20 + 3 * 7), 1600);
    c.detector->dark_doubling_c = 10;
    c.detector->dark_reference_c = 0;
    EXPECT_EQ(dark_at(30), 1600);
    EXPECT_EQ(dark_at(200), 60000) << "the full well";
}

TEST(SensorArray, DefectsHaveTheirSharesAndCurrents) {
    Camera c = counting(1000, 1000);
    c.detector->stages = {dark_current(10'000),  // 100 e-
                          defective_pixels({.dead_share = 0.001,
                                            .hot_share = 0.002,
                                            .hot_e_s = 3e5,
                                            .blinking_share = 0.004,
                                            .blinking_e_s = 2e5})};
    const auto array = SensorArray::create(c, 1);
    const RadianceImage black(c.width, c.height);
    std::vector<std::uint8_t> bytes(2'000'000);
    std::vector<int> times_on(1'000'000);
    constexpr int kFrames = 20;
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
        expose(c, black, 1, frame, bytes, array.get());
        std::size_t dead = 0, hot = 0, blinking = 0;
        for (std::size_t i = 0; i < times_on.size(); ++i) {
            const int e = (bytes[2 * i] | bytes[2 * i + 1] << 8) - 100;
            dead += e == 0, hot += e == 3100, blinking += e == 2100, times_on[i] += e == 2100;
            ASSERT_TRUE(e == 0 || e == 100 || e == 3100 || e == 2100) << e;
        }
        // 4 standard errors: sqrt(1000) = 32, sqrt(2000) = 45, sqrt(2000) = 45.
        EXPECT_NEAR(static_cast<double>(dead), 1000, 127);
        EXPECT_NEAR(static_cast<double>(hot), 2000, 179);
        EXPECT_NEAR(static_cast<double>(blinking), 2000, 179);
    }
    // Each blinking pixel is on in half of the frames: binomial, variance 20 / 4.
    double pixels = 0, sum = 0, squares = 0;
    for (const int n : times_on)
        if (n > 0) ++pixels, sum += n, squares += (n - 10) * (n - 10);
    EXPECT_NEAR(pixels, 4000, 4 * 63);
    EXPECT_NEAR(sum / pixels, 10, 4 * std::sqrt(5 / pixels));
    EXPECT_NEAR(squares / pixels, 5, 4 * 5 * std::sqrt(2 / pixels));
}

TEST(SensorArray, DeadPixelsCollectNoLight) {
    Camera c = counting(200, 200);
    c.detector->stages = {defective_pixels({.dead_share = 0.05})};
    RadianceImage image(200, 200);
    std::fill(image.pixels.begin(), image.pixels.end(), radiance_for(*c.detector, 5000));
    const auto dead = sites_with(electrons(c, image), [](int e) { return e == 0; });
    EXPECT_NEAR(static_cast<double>(dead.size()), 2000, 4 * 44);
    EXPECT_EQ(dead.size() + sites_with(electrons(c, image), [](int e) { return e == 5000; }).size(), 40000u);
}

TEST(SensorArray, SameBytesOnAnyNumberOfThreads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
    const RadianceImage image = motley(322, 262);
    for (const PixelFormat format : kArrayFormats)
        for (const bool moving : {true, false}) {
            const Camera c = with_everything(image.width, image.height, format, moving);
            std::vector<std::uint8_t> one, many;
            tbb::task_arena(1).execute([&] { one = bytes_of(c, image); });
            tbb::task_arena(4).execute([&] { many = bytes_of(c, image); });
            EXPECT_EQ(one, many) << name(format);
        }
}

TEST(SensorArray, AllocatesNothingInAFrame) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "the sanitizer counts on its own";
    const RadianceImage image = motley(322, 262);
    for (const PixelFormat format : kArrayFormats) {
        const Camera c = with_everything(image.width, image.height, format);
        const auto array = SensorArray::create(c, 3);
        std::vector<std::uint8_t> out(frame_bytes({image.width, image.height, format, 0}));
        tbb::task_arena(1).execute([&] {
            expose(c, image, 3, 0, out, array.get());
            const AllocationCounter counter;
            expose(c, image, 3, 1, out, array.get());
            EXPECT_EQ(counter.on_this_thread(), 0u) << name(format);
        });
    }
}

TEST(SensorArray, TakesAnyRadianceAndTheLargestAmounts) {
    const RadianceImage image = motley(62, 30);
    for (const PixelFormat format : kArrayFormats) {
        Camera c = noisy_camera(62, 30, format);
        Detector& d = *c.detector;
        constexpr double kLargest = 1e300;
        d.stages = {dark_current(kLargest), nonuniformity({.prnu = 0.02, .dsnu_e = kLargest}),
                    defective_pixels({.dead_share = 0.01,
                                      .hot_share = 0.01,
                                      .hot_e_s = kLargest,
                                      .blinking_share = 0.01,
                                      .blinking_e_s = kLargest}),
                    blooming(), cosmic_rays({.per_cm2_s = 1e6, .sensitive_depth_m = 0.01})};
        d.temperature_c = 200, d.dark_reference_c = -273.15, d.dark_doubling_c = 1;
        d.pixel_pitch_m = 1;
        d.read_noise_e = d.full_well_e = kLargest;
        EXPECT_EQ(bytes_of(c, image), bytes_of(c, image)) << name(format);
        d.gain_e_per_dn = 1e-300;
        EXPECT_EQ(bytes_of(c, image), bytes_of(c, image)) << name(format);
    }
}

#ifdef NARPA_HAS_EACH_ISA
// The inner loops as each instruction set has them.
using WriteFrame = void(const DetectorConstants&, const SiteConstants&, PixelFormat, const RadianceImage&, float*,
                        std::uint8_t*);
inline void both_ways(const DetectorConstants& s, const SiteConstants& sites, PixelFormat f, const RadianceImage& l,
                      float* charge, std::uint8_t* out) {
    write_sites(s, sites, f, l.pixels, 0, out);
    collect_sites(s, sites, f, l.pixels, 0, charge);
    for (std::uint32_t band = 0; band < sites_per_pixel(f); ++band)
        for (std::size_t x = 0; x < static_cast<std::size_t>(l.width); x += kLanes)
            bloom(charge + band * sites.sites_of_band + x, static_cast<std::size_t>(l.width),
                  static_cast<std::size_t>(l.height), std::min(kLanes, static_cast<std::size_t>(l.width) - x),
                  9000);
    read_sites(s, sites, f, l.pixels, 0, charge, out + l.pixels.size() * bytes_per_pixel(f));
}
[[gnu::flatten]] void sites_on_base_line(const DetectorConstants& s, const SiteConstants& sites, PixelFormat f,
                                         const RadianceImage& l, float* charge, std::uint8_t* out) {
    both_ways(s, sites, f, l, charge, out);
}
[[gnu::flatten, gnu::target("arch=x86-64-v3")]] void sites_on_avx2(const DetectorConstants& s,
                                                                   const SiteConstants& sites, PixelFormat f,
                                                                   const RadianceImage& l, float* charge,
                                                                   std::uint8_t* out) {
    both_ways(s, sites, f, l, charge, out);
}
[[gnu::flatten, gnu::target("arch=x86-64-v4")]] void sites_on_avx512(const DetectorConstants& s,
                                                                     const SiteConstants& sites, PixelFormat f,
                                                                     const RadianceImage& l, float* charge,
                                                                     std::uint8_t* out) {
    both_ways(s, sites, f, l, charge, out);
}
TEST(SensorArray, SameBytesOnEachInstructionSet) {
    const RadianceImage image = motley(118, 30);
    const std::size_t sites_of_band = (image.pixels.size() + kLanes - 1) / kLanes * kLanes;
    std::vector<float> gain(3 * sites_of_band), offset(3 * sites_of_band);
    std::vector<DefectSite> defects;
    for (std::size_t i = 0; i < gain.size(); ++i) {
        const Block w = philox({static_cast<std::uint32_t>(i), 0, 0, 0}, {8, 8});
        gain[i] = 1 + static_cast<float>(w[0] % 100) * 1e-3f;
        offset[i] = static_cast<float>(w[1] % 100) * 0.02f - 1;
        if (w[2] % 20 == 0)
            defects.push_back({static_cast<std::uint32_t>(i), static_cast<DefectSite::Kind>(w[3] % 3)});
    }
    const PhiloxSchedule random(5);
    for (const PixelFormat format : kArrayFormats) {
        const DetectorConstants s = detector_constants(noisy_camera(118, 30, format), 3, 8);
        SiteConstants sites;
        sites.gain = gain.data(), sites.offset = offset.data(), sites.defects = defects;
        sites.sites_of_band = sites_of_band;
        sites.dark_e = 2.5, sites.hot_e = 3000, sites.blinking_e = 500, sites.dsnu_e = 7;
        sites.frame = 8, sites.random = &random;
        const auto frame_by = [&](WriteFrame* frame) {
            std::vector<float> charge(3 * sites_of_band);
            std::vector<std::uint8_t> out(2 * frame_bytes({118, 30, format, 0}));
            frame(s, sites, format, image, charge.data(), out.data());
            return out;
        };
        const std::vector<std::uint8_t> expected = frame_by(&sites_on_base_line);
        for (WriteFrame* const frame : {&sites_on_avx2, &sites_on_avx512}) {
            if (frame == &sites_on_avx2 && !__builtin_cpu_supports("avx2")) continue;
            if (frame == &sites_on_avx512 && !__builtin_cpu_supports("avx512vl")) continue;
            EXPECT_EQ(frame_by(frame), expected) << name(format);
        }
    }
}
#endif

}  // namespace
}  // namespace narpa
