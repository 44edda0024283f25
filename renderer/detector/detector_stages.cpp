#include <fmt/format.h>

#include <array>
#include <cmath>

#include "renderer/detector/blooming.h"
#include "renderer/detector/cosmic_rays.h"
#include "renderer/detector/dark_current.h"
#include "renderer/detector/defective_pixels.h"
#include "renderer/detector/detector_stage.h"
#include "renderer/detector/nonuniformity.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kDetectorRows[]{
    {"exposure_s", rows::number(kPositive)},
    {"exposure_stops", rows::number({.low = -20, .high = 20})},
    {"pixel_pitch_m", rows::number(kPositive)},
    {"f_number", rows::number(kPositive)},
    {"quantum_efficiency", rows::number({.low = 0, .high = 1, .low_open = true})},
    {"full_well_e", rows::number({.low = 1})},
    {"gain_e_per_dn", rows::number(kNotNegative)},
    {"read_noise_e", rows::number(kNotNegative)},
    {"shot_noise", rows::boolean()},
    {"black_level_dn", rows::integer(0, (1 << 16) - 2)},  // `bits` narrows it
    {"bits", rows::integer(8, 16)},
};

}  // namespace

std::span<const DetectorStageKind* const> detector_stage_kinds() {
    static constexpr std::array all{&kDarkCurrent, &kNonuniformity, &kDefectivePixels, &kBlooming, &kCosmicRays};
    return all;
}

void DetectorStage::draw(const PhiloxSchedule&, FixedPatterns&) const {}
void DetectorStage::add_to(SiteAmounts&, const Detector&) const noexcept {}
void DetectorStage::act(const ChargePlane&) const noexcept {}

SiteAmounts site_amounts(const Detector& detector) noexcept {
    SiteAmounts amounts;
    for (const auto& stage : detector.stages) stage->add_to(amounts, detector);
    return amounts;
}

constinit const TableKeys kDetectorKeys{.rows = kDetectorRows, .listed = keys_of<detector_stage_kinds>};

std::optional<Detector> read_detector(TableReader& camera, std::int64_t period_ns,
                                      std::span<const DetectorStageKind* const> stages) {
    auto table = camera.table("detector");
    if (!table) return std::nullopt;
    Detector d;
    table->read("exposure_s", d.exposure_s);
    table->read("pixel_pitch_m", d.pixel_pitch_m);
    table->read("f_number", d.f_number);
    table->read("quantum_efficiency", d.quantum_efficiency);
    table->read("full_well_e", d.full_well_e);
    table->read("gain_e_per_dn", d.gain_e_per_dn);
    table->read("read_noise_e", d.read_noise_e);
    table->read("shot_noise", d.shot_noise);
    table->read("bits", d.bits);
    d.black_level_dn = static_cast<int>(table->integer("black_level_dn", 0, (1 << d.bits) - 2).value_or(0));
    for (const DetectorStageKind* stage : stages) stage->read(*table, d);
    d.exposure_s *= std::exp2(table->number("exposure_stops").value_or(0));
    const double period_s = 1e-9 * static_cast<double>(period_ns);
    if (d.exposure_s > period_s) {
        const std::string what = fmt::format("{} s is longer than a frame, expected at most 1 / rate_hz = {:g} s",
                                             d.exposure_s, period_s);
        table->fail("exposure_s", what);
    }
    table->finish();
    return d;
}

}  // namespace narpa
