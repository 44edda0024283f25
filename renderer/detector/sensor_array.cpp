#include "renderer/detector/sensor_array.h"

#include <algorithm>
#include <iterator>

#include "base/each_isa.h"
#include "base/fnv1a.h"
#include "renderer/detector/collect.h"
#include "renderer/detector/pixel_tasks.h"

namespace narpa {
namespace {

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

}  // namespace

std::unique_ptr<SensorArray> SensorArray::create(const ImageSensor& sensor, std::uint64_t seed) {
    if (sensor.detector == nullptr || sensor.detector->stages.empty()) return nullptr;
    return std::unique_ptr<SensorArray>(new SensorArray(sensor, seed));
}

SensorArray::SensorArray(const ImageSensor& sensor, std::uint64_t seed)
    : random_(seed ^ fnv1a(sensor.name)), bands_(sites_per_pixel(sensor.format)) {
    const std::size_t pixels = static_cast<std::size_t>(sensor.width) * static_cast<std::size_t>(sensor.height);
    sites_of_band_ = (pixels + kLanes - 1) / kLanes * kLanes;
    patterns_.sites = bands_ * sites_of_band_;
    using enum DetectorStage::Place;
    const Stages& stages = sensor.detector->stages;
    for (const auto& stage : stages) stage->draw(random_, patterns_);
    for (const auto place : {collection, transfer})
        std::ranges::copy_if(stages, std::back_inserter(before_full_well_),
                             [&](const auto& stage) { return stage->place() == place; });
    std::ranges::copy_if(stages, std::back_inserter(after_full_well_),
                         [](const auto& stage) { return stage->place() == read_out; });
    if (!before_full_well_.empty() || !after_full_well_.empty()) charge_e_.resize(patterns_.sites);
}

SiteConstants SensorArray::constants(const Detector& d, const DetectorConstants& sensor,
                                     std::uint32_t frame) const noexcept {
    // In single precision, so that the last bit of exp2, which differs between machines, has no effect. Counts stay
    // within the range of noise.h.
    const auto limited = [&](double e) {
        return static_cast<double>(static_cast<float>(std::min({e, 0x1p28 / sensor.dn_per_e, 1e30})));
    };
    const SiteAmounts amounts = site_amounts(d);
    SiteConstants s;
    s.gain = patterns_.gain.empty() ? nullptr : patterns_.gain.data();
    s.offset = patterns_.offset.empty() ? nullptr : patterns_.offset.data();
    s.defects = patterns_.defects;
    s.sites_of_band = sites_of_band_;
    s.dark_e = limited(amounts.dark_e);
    s.hot_e = limited(amounts.hot_e);
    s.blinking_e = limited(amounts.blinking_e);
    s.dsnu_e = std::min(amounts.dsnu_e, 0x1p24 / sensor.dn_per_e);
    s.frame = frame;
    s.random = &random_;
    return s;
}

void SensorArray::expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed,
                         std::uint32_t frame, std::span<std::uint8_t> out) noexcept {
    DetectorConstants shared = detector_constants(sensor, seed, frame);
    const SiteConstants sites = constants(*sensor.detector, shared, frame);
    const std::span<const Rgb> pixels = radiance.pixels;
    const auto bytes_from = [&](std::size_t first) { return out.data() + first * bytes_per_pixel(sensor.format); };
    if (charge_e_.empty())
        return for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
            write_each(shared, sites, sensor.format, part, first, bytes_from(first));
        });
    for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
        collect_each(shared, sites, sensor.format, part, first, charge_e_.data());
    });
    change_charge(sensor, frame, shared);
    for_each_task(pixels, [&](std::size_t first, std::span<const Rgb> part) {
        read_each(shared, sites, sensor.format, part, first, charge_e_.data(), bytes_from(first));
    });
}

void SensorArray::change_charge(const ImageSensor& sensor, std::uint32_t frame,
                                DetectorConstants& shared) noexcept {
    const auto full_well_e = static_cast<float>(shared.full_well_e), limit_e = static_cast<float>(shared.limit_e);
    for (std::uint32_t band = 0; band < bands_; ++band) {
        const auto charge_e = std::span(charge_e_).subspan(band * sites_of_band_, sites_of_band_);
        const ChargePlane plane{sensor, random_, frame, band, full_well_e, charge_e};
        for (const auto& stage : before_full_well_) stage->act(plane);
        if (after_full_well_.empty()) continue;
        for (float& e : charge_e) e = std::min(e, full_well_e);
        for (const auto& stage : after_full_well_) stage->act(plane);
        for (float& e : charge_e) e = std::max(e, -limit_e);
    }
    if (!after_full_well_.empty()) shared.full_well_e = shared.limit_e;
}

}  // namespace narpa
