// A detector without a sensor array: its bytes stay, and cost nothing of what it does not name.
#include <gtest/gtest.h>

#include "tests/renderer/detector/detector_support.h"

namespace narpa {
namespace {

using namespace test;

/// Radiance from 2^-8 to 2^10 and black pixels, of integers alone: the same on every machine.
RadianceImage powers_of_two(int width, int height) {
    RadianceImage image(width, height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const Block w = philox({static_cast<std::uint32_t>(i), 0, 0, 0}, {7, 7});
        const auto level = [&](std::uint32_t word) {
            return w[3] % 3 == 0 ? 0.0f
                                 : static_cast<float>(1024 + word % 1024) * 0x1p-18f *
                                       static_cast<float>(1u << (word >> 10) % 18);
        };
        image.pixels[i] = {level(w[0]), level(w[1]), level(w[2])};
    }
    return image;
}
/// FNV-1a, 64 bits.
std::uint64_t hash(const std::vector<std::uint8_t>& bytes) {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (const std::uint8_t b : bytes) h = (h ^ b) * 0x100000001b3u;
    return h;
}

TEST(PlainDetector, BytesDoNotChange) {
    struct Case {
        const char* name;
        bool detector, shot_noise;
        double read_noise_e;
        int bits;
        std::array<std::uint64_t, 4> of_format;  // GREY, Y16, YUYV, RGB24
    };
    const Case cases[] = {
        {"ideal",
         false,
         false,
         0,
         0,
         {0x9db5d64d2606941bu, 0x1afa9e895988be95u, 0xf11ac99e95e5cfa6u, 0x92dd75d078513c3fu}},
        {"no noise",
         true,
         false,
         0,
         12,
         {0x94829b05a7f7841cu, 0x01f7fbc5c68ebffeu, 0x0aedbd2bcafda0ffu, 0xe4315a9fedc1d1bau}},
        {"shot noise",
         true,
         true,
         0,
         10,
         {0x581317320e59c736u, 0xfff9a37dbc566e30u, 0x868b257439eac4feu, 0x9b289d14f5318454u}},
        {"read noise",
         true,
         false,
         6,
         8,
         {0x49a62e418f2b8b27u, 0x2f999a0104c8b053u, 0xa34ecc41dbcef2c3u, 0x000b63a49d41f495u}},
        {"both",
         true,
         true,
         6,
         12,
         {0xc2377cd200ad4fedu, 0xdd32eeecdb3c8c37u, 0x04fc63bd4a5074b9u, 0x7888e2fe3574ca9au}},
    };
    const RadianceImage image = powers_of_two(206, 87);
    for (const Case& c : cases)
        for (std::size_t f = 0; f < 4; ++f) {
            Camera camera = noisy_camera(206, 87, static_cast<PixelFormat>(f));
            camera.white_radiance = 300;
            if (!c.detector) {
                camera.detector.reset();
            } else {
                camera.detector->shot_noise = c.shot_noise;
                camera.detector->read_noise_e = c.read_noise_e;
                camera.detector->bits = c.bits;
            }
            EXPECT_EQ(hash(bytes_of(camera, image)), c.of_format[f]) << c.name << ", " << name(camera.format);
        }
}

}  // namespace
}  // namespace narpa
