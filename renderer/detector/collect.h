/// renderer/detector/collect.h - light -> charge -> DN of photosites that differ from one another, for batches of
/// kLanes pixels: the inner loops of sensor_array.h, which its source compiles for each instruction set.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "renderer/detector/detector_stage.h"
#include "renderer/detector/digitise.h"

namespace narpa {

/// What is constant over one frame. Photosites of one band follow each other, row by row; then the next band's.
struct SiteConstants {
    const float* gain = nullptr;    ///< null: 1
    const float* offset = nullptr;  ///< in units of dsnu_e; null: 0
    std::span<const DefectSite> defects;
    std::size_t sites_of_band = 0;
    double dark_e = 0, hot_e = 0, blinking_e = 0, dsnu_e = 0;
    std::uint32_t frame = 0;
    const PhiloxSchedule* random = nullptr;
};

/// The defects of one band, in the order of their sites.
class DefectCursor {
public:
    DefectCursor(std::span<const DefectSite> defects, std::size_t first_site) noexcept
        : next_(std::lower_bound(defects.begin(), defects.end(), first_site,
                                 [](const DefectSite& d, std::size_t site) { return d.site < site; })),
          end_(defects.end()) {}

    /// Changes the means of the defects among kLanes photosites from `first` on.
    void apply(const SiteConstants& sites, std::size_t first, Lanes<double>& mean_e) noexcept {
        for (; next_ != end_ && next_->site < first + kLanes; ++next_) {
            double& e = mean_e[next_->site - first];
            switch (next_->kind) {
                case DefectSite::Kind::dead: e = 0; break;
                case DefectSite::Kind::hot: e += sites.hot_e; break;
                case DefectSite::Kind::blinking: e += is_on(sites, next_->site) ? sites.blinking_e : 0; break;
            }
        }
    }

private:
    /// Random telegraph: on or off for a whole frame, with equal probability.
    static bool is_on(const SiteConstants& sites, std::uint32_t site) noexcept {
        const std::uint32_t lane = site % kLanes;
        return (philox(*sites.random, site - lane, sites.frame, SensorDraw::kBlinking).w0[lane] & 1) != 0;
    }

    std::span<const DefectSite>::iterator next_, end_;
};

/// Electrons, and the normal deviate of their read noise.
struct alignas(64) ChargeLanes {
    Lanes<double> e;
    Lanes<float> normal{};
};

/// The charge that light alone would release on average in each photosite of kLanes pixels.
inline std::array<Lanes<double>, 3> site_electrons(const DetectorConstants& sensor, PixelFormat format,
                                                   const Rgb* radiance, std::uint32_t first_pixel) noexcept {
    std::array<Lanes<double>, 3> mean_e;
    if (is_bayer(format))
        mosaic_electrons(sensor, radiance, first_pixel, mean_e);
    else
        mean_electrons(sensor, is_mono(format), radiance, mean_e);
    return mean_e;
}

/// The charge that kLanes photosites collect, of which light releases `mean_e` on average.
inline ChargeLanes collect(const DetectorConstants& sensor, const SiteConstants& sites, const Lanes<double>& mean_e,
                           std::uint32_t first_pixel, std::uint32_t band, DefectCursor& defects) noexcept {
    const std::size_t first = band * sites.sites_of_band + first_pixel;
    ChargeLanes out{mean_e};
    if (sites.gain != nullptr)
        for (std::size_t i = 0; i < kLanes; ++i) out.e[i] *= static_cast<double>(sites.gain[first + i]);
    for (std::size_t i = 0; i < kLanes; ++i) out.e[i] += sites.dark_e;
    defects.apply(sites, first, out.e);
    if (sensor.shot_noise || sensor.read_noise_e > 0) {
        const RandomLanes random = philox(sensor.random, first_pixel, sensor.frame, band);
        const NormalLanes normal = normals(random);
        if (sensor.shot_noise) out.e = poisson(out.e, normal, random);
        out.normal = normal.b;
    }
    return out;
}

/// Read-out of collected charge.
inline DnLanes convert(const DetectorConstants& sensor, const SiteConstants& sites, const ChargeLanes& charge,
                       std::uint32_t first_pixel, std::uint32_t band) noexcept {
    Lanes<double> e;
    for (std::size_t i = 0; i < kLanes; ++i)
        e[i] =
            std::min(charge.e[i], sensor.full_well_e) + sensor.read_noise_e * static_cast<double>(charge.normal[i]);
    if (sites.offset != nullptr) {
        const float* const offset = sites.offset + band * sites.sites_of_band + first_pixel;
        for (std::size_t i = 0; i < kLanes; ++i) e[i] += sites.dsnu_e * static_cast<double>(offset[i]);
    }
    DnLanes dn;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const auto level = static_cast<std::int32_t>(e[i] * sensor.dn_per_e + (sensor.black_dn + 0.5));
        dn[i] = static_cast<std::uint32_t>(std::clamp(level, 0, sensor.top_dn));
    }
    return dn;
}

inline std::array<DefectCursor, 3> defects_from(const SiteConstants& sites, std::size_t first_pixel) noexcept {
    const auto of_band = [&](std::size_t band) {
        return DefectCursor(sites.defects, band * sites.sites_of_band + first_pixel);
    };
    return {of_band(0), of_band(1), of_band(2)};
}

/// Light to bytes for consecutive pixels from `first_pixel` (a multiple of kLanes) on, where no charge moves
/// between photosites.
inline void write_sites(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                        std::span<const Rgb> radiance, std::size_t first_pixel, std::uint8_t* out) noexcept {
    std::array<DefectCursor, 3> defects = defects_from(sites, first_pixel);
    write_batches(format, radiance, first_pixel, out, [&](const Rgb* batch, std::uint32_t pixel, std::uint8_t* to) {
        const std::array<Lanes<double>, 3> mean_e = site_electrons(sensor, format, batch, pixel);
        DnBands c;
        for (std::uint32_t band = 0; band < sites_per_pixel(format); ++band)
            c.dn[band] = convert(sensor, sites, collect(sensor, sites, mean_e[band], pixel, band, defects[band]),
                                 pixel, band);
        put_lanes(sensor.bits, sample_format(format), c, to);
    });
}

/// Light to charge.
inline void collect_sites(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                          std::span<const Rgb> radiance, std::size_t first_pixel, float* charge_e) noexcept {
    std::array<DefectCursor, 3> defects = defects_from(sites, first_pixel);
    for (std::size_t i = 0; i < radiance.size(); i += kLanes) {
        Lanes<Rgb> batch{};
        std::copy_n(&radiance[i], std::min(kLanes, radiance.size() - i), batch.begin());
        const auto pixel = static_cast<std::uint32_t>(first_pixel + i);
        const std::array<Lanes<double>, 3> mean_e = site_electrons(sensor, format, batch.data(), pixel);
        for (std::uint32_t band = 0; band < sites_per_pixel(format); ++band) {
            const ChargeLanes charge = collect(sensor, sites, mean_e[band], pixel, band, defects[band]);
            float* const to = charge_e + band * sites.sites_of_band + pixel;
            for (std::size_t k = 0; k < kLanes; ++k) to[k] = static_cast<float>(charge.e[k]);
        }
    }
}

/// Charge to bytes. Of the radiance only the number of pixels is read.
inline void read_sites(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                       std::span<const Rgb> radiance, std::size_t first_pixel, const float* charge_e,
                       std::uint8_t* out) noexcept {
    write_batches(format, radiance, first_pixel, out, [&](const Rgb*, std::uint32_t pixel, std::uint8_t* to) {
        DnBands c;
        for (std::uint32_t band = 0; band < sites_per_pixel(format); ++band) {
            ChargeLanes charge;
            const float* const from = charge_e + band * sites.sites_of_band + pixel;
            for (std::size_t k = 0; k < kLanes; ++k) charge.e[k] = static_cast<double>(from[k]);
            if (sensor.read_noise_e > 0)
                charge.normal = normals(philox(sensor.random, pixel, sensor.frame, band)).b;
            c.dn[band] = convert(sensor, sites, charge, pixel, band);
        }
        put_lanes(sensor.bits, sample_format(format), c, to);
    });
}

}  // namespace narpa
