/// renderer/detector/digitise.h - radiance -> electrons -> DN -> bytes for batches of kLanes pixels: the inner loop
/// of `expose`. detector.cpp compiles it for each instruction set.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "base/pixel_format.h"
#include "renderer/detector/dark_levels.h"
#include "renderer/detector/detector_settings.h"
#include "renderer/detector/noise.h"
#include "renderer/detector/pixel_bytes.h"

namespace narpa {

/// What is constant over one frame. Signals and noise are limited to 2^28 DN, so that a level in DN fits an
/// integer.
struct DetectorConstants {
    std::array<double, 3> electrons_per_radiance{};
    std::array<float, 3> radiance_max{};  ///< of each band
    double full_well_e = 0, read_noise_e = 0, dn_per_e = 0, black_dn = 0;
    double limit_e = 0;        ///< of signals and noise
    std::int32_t top_dn = 0;   ///< highest level of the converter
    std::int32_t full_dn = 0;  ///< level of a full well without noise, at most top_dn
    int bits = 8;
    bool shot_noise = false;
    std::uint32_t frame = 0;
    double rows_per_pixel = 0;                     ///< 1 / the image's width
    std::array<Lanes<std::uint32_t>, 2> mosaic{};  ///< Bayer: bands of kLanes pixels of an even and of an odd row
    PhiloxSchedule random{0};
    DarkLevels dark;
};
[[nodiscard]] DetectorConstants detector_constants(const ImageSensor& sensor, std::uint64_t seed,
                                                   std::uint32_t frame) noexcept;

/// Band by band, clamped to 0 .. radiance_max; NaN becomes 0.
inline RgbLanes load_radiance(const DetectorConstants& sensor, const Rgb* radiance) noexcept {
    const auto clamped = [](float v, float max) {
        // Bit patterns order as: positive numbers, infinity, NaN, negative numbers.
        constexpr auto kInfinityBits = std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity());
        const auto bits = std::bit_cast<std::uint32_t>(v);
        return std::bit_cast<float>(bits <= kInfinityBits ? std::min(bits, std::bit_cast<std::uint32_t>(max)) : 0u);
    };
    const auto [r_max, g_max, b_max] = sensor.radiance_max;
    RgbLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        out.r[i] = clamped(radiance[i].x, r_max);
        out.g[i] = clamped(radiance[i].y, g_max);
        out.b[i] = clamped(radiance[i].z, b_max);
    }
    return out;
}

/// Random words of pixels without light, one each: a block of four words serves four pixels, so kPixels are drawn
/// at a time.
class DarkWords {
public:
    static constexpr std::uint32_t kPixels = 4 * kLanes;

    /// For kLanes pixels from `first_pixel` on, a multiple of kLanes.
    const Lanes<std::uint32_t>& of(const DetectorConstants& sensor, std::uint32_t first_pixel,
                                   std::uint32_t band) noexcept {
        Band& b = bands_[band];
        const std::uint32_t group = first_pixel / kPixels;
        if (!b.drawn || b.group != group) {
            b.words = philox(sensor.random, group * static_cast<std::uint32_t>(kLanes), sensor.frame,
                             kFirstCounter + band);
            b.drawn = true;
            b.group = group;
        }
        switch (first_pixel / kLanes % 4) {
            case 0: return b.words.w0;
            case 1: return b.words.w1;
            case 2: return b.words.w2;
            default: return b.words.w3;
        }
    }

private:
    static constexpr std::uint32_t kFirstCounter = 4;  ///< beyond those of digitise_lit
    struct Band {
        RandomLanes words;
        std::uint32_t group;
        bool drawn = false;
    };
    std::array<Band, 3> bands_;
};

/// For pixels with light, and for dark ones if there is no table.
inline DnLanes digitise_lit(const DetectorConstants& sensor, const Lanes<double>& mean_e, bool any_light,
                            std::uint32_t first_pixel, std::uint32_t band) noexcept {
    Lanes<double> e = mean_e;
    std::int32_t top_dn = sensor.full_dn;
    if (sensor.read_noise_e > 0 || (sensor.shot_noise && any_light)) {
        const RandomLanes random = philox(sensor.random, first_pixel, sensor.frame, band);
        const NormalLanes normal = normals(random);
        if (sensor.shot_noise) e = poisson(mean_e, normal, random);
        for (std::size_t i = 0; i < kLanes; ++i)
            e[i] = std::min(e[i], sensor.full_well_e) + sensor.read_noise_e * static_cast<double>(normal.b[i]);
        top_dn = sensor.top_dn;
    }
    DnLanes dn;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const auto level = static_cast<std::int32_t>(e[i] * sensor.dn_per_e + (sensor.black_dn + 0.5));
        dn[i] = static_cast<std::uint32_t>(std::clamp(level, 0, top_dn));
    }
    return dn;
}

inline DnLanes digitise_dark(const DetectorConstants& sensor, const Lanes<std::uint32_t>& words) noexcept {
    DnLanes dn;
    for (std::size_t i = 0; i < kLanes; ++i) dn[i] = sensor.dark.level(words[i]);
    return dn;
}

/// A pixel's noise depends only on its own signal, not on the rest of its batch.
inline DnLanes digitise(const DetectorConstants& sensor, const Lanes<double>& mean_e, std::uint32_t first_pixel,
                        std::uint32_t band, DarkWords& dark_words) noexcept {
    std::uint64_t lit = 0;
    for (std::size_t i = 0; i < kLanes; ++i) lit += mean_e[i] > 0 ? 1u : 0u;
    const bool dark = sensor.dark.any() && lit < kLanes;
    if (dark && lit == 0) return digitise_dark(sensor, dark_words.of(sensor, first_pixel, band));
    DnLanes dn = digitise_lit(sensor, mean_e, lit > 0, first_pixel, band);
    if (!dark) return dn;
    const DnLanes without = digitise_dark(sensor, dark_words.of(sensor, first_pixel, band));
    for (std::size_t i = 0; i < kLanes; ++i) dn[i] = mean_e[i] > 0 ? dn[i] : without[i];
    return dn;
}

inline bool is_black(const Rgb* radiance) noexcept {
    std::array<std::uint32_t, 3 * kLanes> bits;
    static_assert(sizeof bits == kLanes * sizeof(Rgb));
    std::memcpy(bits.data(), radiance, sizeof bits);
    std::uint32_t any = 0;
    for (const std::uint32_t of_one : bits) any |= of_one;
    return any == 0;
}

/// Photosites per pixel: one, or one for each band.
inline std::uint32_t sites_per_pixel(PixelFormat f) noexcept {
    return f == PixelFormat::rgb24 || f == PixelFormat::yuyv ? 3 : 1;
}

/// Mean of the electrons that light releases in kLanes pixels: of each band, or of all bands in the first.
inline void mean_electrons(const DetectorConstants& sensor, bool mono, const Rgb* radiance,
                           std::array<Lanes<double>, 3>& mean_e) noexcept {
    const RgbLanes l = load_radiance(sensor, radiance);
    const auto [red, green, blue] = sensor.electrons_per_radiance;
    for (std::size_t i = 0; i < kLanes; ++i) mean_e[0][i] = red * static_cast<double>(l.r[i]);
    for (std::size_t i = 0; i < kLanes; ++i) mean_e[1][i] = green * static_cast<double>(l.g[i]);
    for (std::size_t i = 0; i < kLanes; ++i) mean_e[2][i] = blue * static_cast<double>(l.b[i]);
    if (mono)
        for (std::size_t i = 0; i < kLanes; ++i) mean_e[0][i] = mean_e[0][i] + mean_e[1][i] + mean_e[2][i];
}

/// The same for a Bayer mosaic: the band of each pixel's filter, in mean_e[0]. The image's width is even, so a
/// pixel's column is even if its lane is.
inline void mosaic_electrons(const DetectorConstants& sensor, const Rgb* radiance, std::uint32_t first_pixel,
                             std::array<Lanes<double>, 3>& mean_e) noexcept {
    mean_electrons(sensor, false, radiance, mean_e);
    for (std::size_t i = 0; i < kLanes; ++i) {
        // The product is at least half a pixel's share of a row from the next whole number.
        const double pixel = static_cast<double>(static_cast<std::int32_t>(first_pixel + i)) + 0.5;
        const bool odd = (static_cast<std::int32_t>(pixel * sensor.rows_per_pixel) & 1) != 0;
        const std::uint32_t band = odd ? sensor.mosaic[1][i] : sensor.mosaic[0][i];
        mean_e[0][i] = band == 0 ? mean_e[0][i] : band == 1 ? mean_e[1][i] : mean_e[2][i];
    }
}

inline DnBands digitise(const DetectorConstants& sensor, bool mono, const Rgb* radiance, std::uint32_t first_pixel,
                        DarkWords& dark_words) noexcept {
    DnBands out;
    const std::uint32_t bands = mono ? 1 : 3;
    if (sensor.dark.any() && is_black(radiance)) {
        for (std::uint32_t band = 0; band < bands; ++band)
            out.dn[band] = digitise_dark(sensor, dark_words.of(sensor, first_pixel, band));
        return out;
    }
    std::array<Lanes<double>, 3> mean_e;
    mean_electrons(sensor, mono, radiance, mean_e);
    for (std::uint32_t band = 0; band < bands; ++band)
        out.dn[band] = digitise(sensor, mean_e[band], first_pixel, band, dark_words);
    return out;
}

/// The same for a Bayer mosaic, in dn[0].
inline DnBands digitise_mosaic(const DetectorConstants& sensor, const Rgb* radiance, std::uint32_t first_pixel,
                               DarkWords& dark_words) noexcept {
    DnBands out;
    std::array<Lanes<double>, 3> mean_e;
    mosaic_electrons(sensor, radiance, first_pixel, mean_e);
    out.dn[0] = digitise(sensor, mean_e[0], first_pixel, 0, dark_words);
    return out;
}

/// Consecutive pixels from `first_pixel` of the image on, a multiple of kLanes, whose bytes start at `out`.
/// `write(radiance, first_pixel, out)` writes kLanes pixels.
template <class Write>
void write_batches(PixelFormat format, std::span<const Rgb> radiance, std::size_t first_pixel, std::uint8_t* out,
                   const Write& write) noexcept {
    const std::size_t bytes = bytes_per_pixel(format);
    Lanes<Rgb> rest{};
    std::array<std::uint8_t, 3 * kLanes> rest_out;
    for (std::size_t i = 0; i < radiance.size(); i += kLanes) {
        const std::size_t count = std::min(kLanes, radiance.size() - i);
        const bool whole = count == kLanes;
        if (!whole) std::copy_n(&radiance[i], count, rest.begin());
        write(whole ? &radiance[i] : rest.data(), static_cast<std::uint32_t>(first_pixel + i),
              whole ? out + i * bytes : rest_out.data());
        if (!whole) std::copy_n(rest_out.begin(), count * bytes, out + i * bytes);
    }
}

/// For a detector whose photosites are all alike, in a format without a mosaic.
inline void write_pixels(const DetectorConstants& sensor, PixelFormat format, std::span<const Rgb> radiance,
                         std::size_t first_pixel, std::uint8_t* out) noexcept {
    DarkWords dark_words;
    write_batches(format, radiance, first_pixel, out, [&](const Rgb* batch, std::uint32_t pixel, std::uint8_t* to) {
        put_lanes(sensor.bits, format, digitise(sensor, is_mono(format), batch, pixel, dark_words), to);
    });
}

/// The same for a Bayer mosaic. A separate function, because GCC compiles both worse when they are one.
inline void write_mosaic_pixels(const DetectorConstants& sensor, PixelFormat format, std::span<const Rgb> radiance,
                                std::size_t first_pixel, std::uint8_t* out) noexcept {
    DarkWords dark_words;
    write_batches(format, radiance, first_pixel, out, [&](const Rgb* batch, std::uint32_t pixel, std::uint8_t* to) {
        put_lanes(sensor.bits, sample_format(format), digitise_mosaic(sensor, batch, pixel, dark_words), to);
    });
}

}  // namespace narpa
