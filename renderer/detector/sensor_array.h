/// renderer/detector/sensor_array.h - the stages of a detector at work: differences between photosites, and charge
/// that is added, moves or is read out otherwise. detector_stage.h has their order.
///
/// A photosite with a mean of `m` photoelectrons collects Poisson(gain * m + dark current * exposure time). The
/// same mean draws the same noise as in detector.h.
///
/// Fixed patterns depend only on (seed, camera name); events also on the frame number.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/counter_random.h"
#include "base/radiance_image.h"
#include "renderer/detector/detector_stage.h"

namespace narpa {

struct DetectorConstants;
struct SiteConstants;

class SensorArray {
public:
    /// Draws the patterns and allocates the charge buffer. Null if the detector has no stages.
    [[nodiscard]] static std::unique_ptr<SensorArray> create(const ImageSensor& sensor, std::uint64_t seed);

    /// `expose` of detector.h, for the sensor that this array was created for (its exposure, temperature and noise
    /// may change). Allocates nothing.
    void expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
                std::span<std::uint8_t> out) noexcept;

private:
    using Stages = std::vector<std::shared_ptr<const DetectorStage>>;

    SensorArray(const ImageSensor& sensor, std::uint64_t seed);
    [[nodiscard]] SiteConstants constants(const Detector& detector, const DetectorConstants& sensor,
                                          std::uint32_t frame) const noexcept;
    /// What happens to the charge of whole bands. Sets the full well that is still to be applied.
    void change_charge(const ImageSensor& sensor, std::uint32_t frame, DetectorConstants& shared) noexcept;

    PhiloxSchedule random_;
    std::uint32_t bands_;        ///< photosites of a pixel
    std::size_t sites_of_band_;  ///< padded to whole batches
    FixedPatterns patterns_;
    Stages before_full_well_, after_full_well_;  ///< that act on the charge of whole bands, in order
    std::vector<float> charge_e_;                ///< of each photosite; empty unless a stage acts on it
};

}  // namespace narpa
