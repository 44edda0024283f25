#include "renderer/detector/sensor_array.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <string_view>

#include "base/each_isa.h"
#include "renderer/detector/collect.h"
#include "renderer/detector/cosmic_rays.h"
#include "renderer/detector/detector.h"
#include "renderer/detector/pixel_tasks.h"

namespace narpa {
namespace {

/// FNV-1a, 64 bits.
std::uint64_t hash(std::string_view text) noexcept {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (const char c : text) h = (h ^ static_cast<std::uint8_t>(c)) * 0x100000001b3u;
    return h;
}

bool has_array(const Detector& d) noexcept {
    return d.dark_current_e_s > 0 || d.prnu > 0 || d.dsnu_e > 0 || d.dead_pixel_share > 0 ||
           d.hot_pixel_share > 0 || d.blinking_pixel_share > 0 || d.blooming || d.cosmic_rays_per_cm2_s > 0;
}

NARPA_EACH_ISA void write_each(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                               std::span<const Rgb> radiance, std::size_t first_pixel, std::uint8_t* out) noexcept {
    write_sites(sensor, sites, format, radiance, first_pixel, out);
}
NARPA_EACH_ISA void collect_each(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                                 std::span<const Rgb> radiance, std::size_t first_pixel, float* charge_e) noexcept {
    collect_sites(sensor, sites, format, radiance, first_pixel, charge_e);
}
NARPA_EACH_ISA void read_each(const DetectorConstants& sensor, const SiteConstants& sites, PixelFormat format,
                              std::span<const Rgb> radiance, std::size_t first_pixel, const float* charge_e,
                              std::uint8_t* out) noexcept {
    read_sites(sensor, sites, format, radiance, first_pixel, charge_e, out);
}
NARPA_EACH_ISA void bloom_each(float* charge_e, std::size_t width, std::size_t height, std::size_t first,
                               float full_well_e) noexcept {
    if (width - first >= kLanes)
        bloom(charge_e + first, width, height, kLanes, full_well_e);
    else
        bloom(charge_e + first, width, height, width - first, full_well_e);
}

}  // namespace

std::unique_ptr<SensorArray> SensorArray::create(const Camera& camera, std::uint64_t seed) {
    if (!camera.detector || !has_array(*camera.detector)) return nullptr;
    return std::unique_ptr<SensorArray>(new SensorArray(camera, seed));
}

SensorArray::SensorArray(const Camera& camera, std::uint64_t seed)
    : random_(seed ^ hash(camera.name)), bands_(sites_per_pixel(camera.format)) {
    const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    sites_of_band_ = (pixels + kLanes - 1) / kLanes * kLanes;
    const Detector& d = *camera.detector;
    if (d.prnu > 0 || d.dsnu_e > 0) draw_patterns(d);
    if (d.dead_pixel_share + d.hot_pixel_share + d.blinking_pixel_share > 0) draw_defects(d);
    if (d.blooming || d.cosmic_rays_per_cm2_s > 0) charge_e_.resize(bands_ * sites_of_band_);
}

void SensorArray::draw_patterns(const Detector& d) {
    const std::size_t sites = bands_ * sites_of_band_;
    if (d.prnu > 0) gain_.resize(sites);
    if (d.dsnu_e > 0) offset_.resize(sites);
    for (std::size_t first = 0; first < sites; first += kLanes) {
        const NormalLanes normal =
            normals(philox(random_, static_cast<std::uint32_t>(first), 0, SensorDraw::kPattern));
        const auto prnu = static_cast<float>(d.prnu);
        for (std::size_t i = 0; i < kLanes && d.prnu > 0; ++i)
            gain_[first + i] = std::max(0.0f, 1 + prnu * normal.a[i]);
        if (d.dsnu_e > 0) std::copy(normal.b.begin(), normal.b.end(), &offset_[first]);
    }
}

void SensorArray::draw_defects(const Detector& d) {
    const double dead = d.dead_pixel_share * 0x1p32, hot = dead + d.hot_pixel_share * 0x1p32,
                 blinking = hot + d.blinking_pixel_share * 0x1p32;
    for (std::size_t first = 0; first < bands_ * sites_of_band_; first += kLanes) {
        const RandomLanes random = philox(random_, static_cast<std::uint32_t>(first), 0, SensorDraw::kDefects);
        for (std::size_t i = 0; i < kLanes; ++i) {
            const double word = random.w0[i];
            if (word < blinking)
                defects_.push_back({static_cast<std::uint32_t>(first + i), word < dead ? DefectSite::Kind::dead
                                                                           : word < hot
                                                                               ? DefectSite::Kind::hot
                                                                               : DefectSite::Kind::blinking});
        }
    }
    defects_.shrink_to_fit();
}

SiteConstants SensorArray::constants(const Detector& d, const DetectorConstants& sensor,
                                     std::uint32_t frame) const noexcept {
    // In single precision, so that the last bit of exp2, which differs between machines, has no effect. Counts stay
    // within the range of noise.h.
    const auto limited = [&](double e) {
        return static_cast<double>(static_cast<float>(std::min({e, 0x1p28 / sensor.dn_per_e, 1e30})));
    };
    SiteConstants s;
    s.gain = gain_.empty() ? nullptr : gain_.data();
    s.offset = offset_.empty() ? nullptr : offset_.data();
    s.defects = defects_;
    s.sites_of_band = sites_of_band_;
    s.dark_e = limited(dark_electrons(d));
    s.hot_e = limited(d.hot_pixel_e_s * dark_seconds(d));
    s.blinking_e = limited(d.blinking_e_s * dark_seconds(d));
    s.dsnu_e = std::min(d.dsnu_e, 0x1p24 / sensor.dn_per_e);
    s.frame = frame;
    s.random = &random_;
    return s;
}

void SensorArray::expose(const Camera& camera, const RadianceImage& radiance, std::uint64_t seed,
                         std::uint32_t frame, std::span<std::uint8_t> out) noexcept {
    const DetectorConstants sensor = detector_constants(camera, seed, frame);
    const SiteConstants sites = constants(*camera.detector, sensor, frame);
    const std::span<const Rgb> pixels = radiance.pixels;
    const auto bytes_from = [&](std::size_t first) { return out.data() + first * bytes_per_pixel(camera.format); };
    if (charge_e_.empty())
        return for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
            write_each(sensor, sites, camera.format, part, first, bytes_from(first));
        });
    for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
        collect_each(sensor, sites, camera.format, part, first, charge_e_.data());
    });
    move_charge(camera, frame, static_cast<float>(sensor.full_well_e));
    for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
        read_each(sensor, sites, camera.format, part, first, charge_e_.data(), bytes_from(first));
    });
}

void SensorArray::move_charge(const Camera& camera, std::uint32_t frame, float full_well_e) noexcept {
    const auto width = static_cast<std::size_t>(camera.width), height = static_cast<std::size_t>(camera.height);
    for (std::uint32_t band = 0; band < bands_; ++band) {
        const auto plane = std::span(charge_e_).subspan(band * sites_of_band_, sites_of_band_);
        if (camera.detector->cosmic_rays_per_cm2_s > 0) add_cosmic_rays(camera, random_, frame, band, plane);
        if (camera.detector->blooming)
            tbb::parallel_for(std::size_t{0}, (width + kLanes - 1) / kLanes, [&](std::size_t block) {
                bloom_each(plane.data(), width, height, block * kLanes, full_well_e);
            });
    }
}

}  // namespace narpa
