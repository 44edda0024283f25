#include "renderer/sensor/detector.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "renderer/sensor/counter_random.h"
#include "renderer/sensor/solar_bands.h"

namespace narpa {
namespace {

constexpr int kRowsPerTask = 16;

bool is_mono(PixelFormat f) {
    return f == PixelFormat::grey || f == PixelFormat::y16;
}

/// A sensor's constants over one frame, and its chain from radiance to DN.
struct Sensor {
    std::array<double, 3> electrons_per_radiance;
    double full_well_e, dn_per_e, read_noise_e, black_dn, top_dn;
    int bits;
    bool shot_noise;
    std::uint64_t seed;
    std::uint32_t frame;

    [[nodiscard]] double electrons(const Rgb& radiance, int band) const {
        const double e =
            electrons_per_radiance[static_cast<std::size_t>(band)] * static_cast<double>(radiance[band]);
        return e > 0 ? e : 0;  // and nothing for a radiance that is not a number
    }

    [[nodiscard]] std::uint32_t digitise(double mean_e, std::size_t pixel, std::uint32_t band) const {
        double e = mean_e;
        if (shot_noise || read_noise_e > 0) {
            const PixelNoise noise = pixel_noise(seed, frame, static_cast<std::uint32_t>(pixel), band);
            if (shot_noise) e = poisson(mean_e, noise.normal_a, noise.uniform);
            e = std::min(e, full_well_e) + read_noise_e * noise.normal_b;
        } else {
            e = std::min(e, full_well_e);
        }
        const double dn = std::floor(black_dn + e * dn_per_e + 0.5);
        return static_cast<std::uint32_t>(std::clamp(dn, 0.0, top_dn));
    }

    [[nodiscard]] std::uint32_t mono(const Rgb& radiance, std::size_t pixel) const {
        return digitise(electrons(radiance, 0) + electrons(radiance, 1) + electrons(radiance, 2), pixel, 0);
    }
    [[nodiscard]] std::array<std::uint8_t, 3> colour(const Rgb& radiance, std::size_t pixel) const {
        std::array<std::uint8_t, 3> c{};
        for (int b = 0; b < 3; ++b)
            c[static_cast<std::size_t>(b)] = static_cast<std::uint8_t>(
                digitise(electrons(radiance, b), pixel, static_cast<std::uint32_t>(b)) >> (bits - 8));
        return c;
    }
};

Sensor real_sensor(const Detector& d, std::uint64_t seed, std::uint32_t frame) {
    return {{electrons_per_radiance(d, 0), electrons_per_radiance(d, 1), electrons_per_radiance(d, 2)},
            d.full_well_e,
            1 / gain_e_per_dn(d),
            d.read_noise_e,
            static_cast<double>(d.black_level_dn),
            std::exp2(d.bits) - 1,
            d.bits,
            d.shot_noise,
            seed,
            frame};
}

/// Without noise, as many bits as the format shows, white at the top.
Sensor ideal_sensor(const Camera& c) {
    const int bits = c.format == PixelFormat::y16 ? 16 : 8;
    const double top = std::exp2(bits) - 1, k = (is_mono(c.format) ? 1.0 / 3 : 1.0) / c.white_radiance;
    return {{k, k, k}, std::numeric_limits<double>::infinity(), top, 0, 0, top, bits, false, 0, 0};
}

/// ITU-R BT.601, 8 bits: luma 16..235, chroma 16..240.
std::uint8_t luma(const std::array<std::uint8_t, 3>& c) {
    return static_cast<std::uint8_t>(std::lround(16 + (65.481 * c[0] + 128.553 * c[1] + 24.966 * c[2]) / 255));
}
std::array<std::uint8_t, 2> chroma(const std::array<std::uint8_t, 3>& a, const std::array<std::uint8_t, 3>& b) {
    const double red = 0.5 * (a[0] + b[0]), green = 0.5 * (a[1] + b[1]), blue = 0.5 * (a[2] + b[2]);
    return {static_cast<std::uint8_t>(std::lround(128 + (-37.797 * red - 74.203 * green + 112 * blue) / 255)),
            static_cast<std::uint8_t>(std::lround(128 + (112 * red - 93.786 * green - 18.214 * blue) / 255))};
}

void write_row(const Sensor& sensor, PixelFormat format, std::span<const Rgb> row, std::size_t first_pixel,
               std::uint8_t* out) {
    switch (format) {
        case PixelFormat::grey:
            for (std::size_t x = 0; x < row.size(); ++x)
                out[x] = static_cast<std::uint8_t>(sensor.mono(row[x], first_pixel + x) >> (sensor.bits - 8));
            return;
        case PixelFormat::y16:
            for (std::size_t x = 0; x < row.size(); ++x) {
                const std::uint32_t dn = sensor.mono(row[x], first_pixel + x) << (16 - sensor.bits);
                out[2 * x] = static_cast<std::uint8_t>(dn);
                out[2 * x + 1] = static_cast<std::uint8_t>(dn >> 8);
            }
            return;
        case PixelFormat::rgb24:
            for (std::size_t x = 0; x < row.size(); ++x) {
                const auto c = sensor.colour(row[x], first_pixel + x);
                std::copy(c.begin(), c.end(), out + 3 * x);
            }
            return;
        case PixelFormat::yuyv:
            for (std::size_t x = 0; x + 1 < row.size(); x += 2) {
                const auto a = sensor.colour(row[x], first_pixel + x);
                const auto b = sensor.colour(row[x + 1], first_pixel + x + 1);
                const auto uv = chroma(a, b);
                const std::array<std::uint8_t, 4> pair{luma(a), uv[0], luma(b), uv[1]};
                std::copy(pair.begin(), pair.end(), out + 2 * x);
            }
            return;
    }
}

}  // namespace

double electrons_per_radiance(const Detector& d, int band) noexcept {
    const SolarBand& b = kSolarBands[static_cast<std::size_t>(band)];
    const double irradiance = std::numbers::pi * b.fraction / (4 * d.f_number * d.f_number);
    const double energy_j = irradiance * d.pixel_pitch_m * d.pixel_pitch_m * d.exposure_s;
    return energy_j * b.mean_wavelength_m / (kPlanck_j_s * kLightSpeed_m_s) * d.quantum_efficiency;
}

double gain_e_per_dn(const Detector& d) noexcept {
    return d.gain_e_per_dn > 0 ? d.gain_e_per_dn : d.full_well_e / (std::exp2(d.bits) - 1 - d.black_level_dn);
}

void expose(const Camera& camera, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
            std::span<std::uint8_t> out) noexcept {
    const Sensor sensor = camera.detector ? real_sensor(*camera.detector, seed, frame) : ideal_sensor(camera);
    const std::size_t width = static_cast<std::size_t>(radiance.width);
    tbb::parallel_for(
        tbb::blocked_range<int>(0, radiance.height, kRowsPerTask),
        [&](const tbb::blocked_range<int>& rows) {
            for (int y = rows.begin(); y != rows.end(); ++y) {
                const std::size_t first = static_cast<std::size_t>(y) * width;
                write_row(sensor, camera.format, std::span(radiance.pixels).subspan(first, width), first,
                          out.data() + first * bytes_per_pixel(camera.format));
            }
        },
        tbb::simple_partitioner());
}

}  // namespace narpa
