#include "renderer/detector/detector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/detector/detector_stage.h"
#include "renderer/detector/digitise.h"
#include "renderer/detector/pixel_tasks.h"
#include "renderer/detector/sensor_array.h"
#include "renderer/detector/solar_bands.h"

namespace narpa {
namespace {

NARPA_EACH_ISA void write(const DetectorConstants& sensor, PixelFormat format, std::span<const Rgb> radiance,
                          std::size_t first_pixel, std::uint8_t* out) noexcept {
    write_pixels(sensor, format, radiance, first_pixel, out);
}
NARPA_EACH_ISA void write_mosaic(const DetectorConstants& sensor, PixelFormat format, std::span<const Rgb> radiance,
                                 std::size_t first_pixel, std::uint8_t* out) noexcept {
    write_mosaic_pixels(sensor, format, radiance, first_pixel, out);
}

void set_detector(const Detector& d, DetectorConstants& s) {
    for (int b = 0; b < 3; ++b)
        s.electrons_per_radiance[static_cast<std::size_t>(b)] = electrons_per_radiance(d, b);
    s.full_well_e = d.full_well_e;
    s.read_noise_e = d.read_noise_e;
    s.dn_per_e = 1 / gain_e_per_dn(d);
    s.black_dn = d.black_level_dn;
    s.bits = d.bits;
    s.shot_noise = d.shot_noise;
}

/// No noise, as many bits as the format has, white_radiance at full scale.
void set_ideal(const ImageSensor& c, DetectorConstants& s) {
    s.bits = is_16_bit(c.format) ? 16 : 8;
    s.electrons_per_radiance.fill((is_mono(c.format) ? 1.0 / 3 : 1.0) / c.white_radiance);
    s.full_well_e = std::numeric_limits<double>::infinity();
    s.dn_per_e = (1 << s.bits) - 1;
}

void set_mosaic(const ImageSensor& c, DetectorConstants& s) {
    s.rows_per_pixel = 1.0 / c.width;
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < static_cast<int>(kLanes); ++x)
            s.mosaic[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] = bayer_band(c.format, x, y);
}

}  // namespace

DetectorConstants detector_constants(const ImageSensor& c, std::uint64_t seed, std::uint32_t frame) noexcept {
    DetectorConstants s;
    if (c.detector) {
        set_detector(*c.detector, s);
    } else {
        set_ideal(c, s);
    }
    s.limit_e = std::min(0x1p28 / s.dn_per_e, 0x1p120);  // range of the samplers in noise.h
    for (std::size_t b = 0; b < 3; ++b)
        s.radiance_max[b] = static_cast<float>(std::min(s.limit_e / s.electrons_per_radiance[b], 1e30));
    s.full_well_e = std::min(s.full_well_e, s.limit_e);
    s.read_noise_e = std::min(s.read_noise_e, s.limit_e);
    s.top_dn = (1 << s.bits) - 1;
    s.full_dn = std::min(s.top_dn, static_cast<std::int32_t>(s.full_well_e * s.dn_per_e + (s.black_dn + 0.5)));
    s.dark = DarkLevels(s.black_dn, s.read_noise_e * s.dn_per_e, s.top_dn);
    s.frame = frame;
    s.random = PhiloxSchedule(seed);
    if (is_bayer(c.format)) set_mosaic(c, s);
    return s;
}

double electrons_per_radiance(const Detector& d, int band) noexcept {
    const SolarBand& b = kSolarBands[static_cast<std::size_t>(band)];
    const double irradiance = std::numbers::pi * b.fraction / (4 * d.f_number * d.f_number);
    const double energy_j = irradiance * d.pixel_pitch_m * d.pixel_pitch_m * d.exposure_s;
    return energy_j * b.mean_wavelength_m / (kPlanck_j_s * kLightSpeed_m_s) * d.quantum_efficiency;
}

double gain_e_per_dn(const Detector& d) noexcept {
    return d.gain_e_per_dn > 0 ? d.gain_e_per_dn : d.full_well_e / (std::exp2(d.bits) - 1 - d.black_level_dn);
}

double dark_seconds(const Detector& d) noexcept {
    return d.exposure_s * std::exp2((d.temperature_c - d.dark_reference_c) / d.dark_doubling_c);
}

double dark_electrons(const Detector& d) noexcept {
    return site_amounts(d).dark_e;
}

void expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
            std::span<std::uint8_t> out, SensorArray* array) noexcept {
    if (array != nullptr) return array->expose(sensor, radiance, seed, frame, out);
    const DetectorConstants constants = detector_constants(sensor, seed, frame);
    for_each_task(radiance.pixels, [&](std::size_t first, std::span<const Rgb> part) {
        std::uint8_t* const bytes = out.data() + first * bytes_per_pixel(sensor.format);
        is_bayer(sensor.format) ? write_mosaic(constants, sensor.format, part, first, bytes)
                                : write(constants, sensor.format, part, first, bytes);
    });
}

void expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
            std::span<std::uint8_t> out) {
    expose(sensor, radiance, seed, frame, out, SensorArray::create(sensor, seed).get());
}

}  // namespace narpa
