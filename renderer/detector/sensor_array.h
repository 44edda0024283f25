/// renderer/detector/sensor_array.h - differences between photosites: PRNU, DSNU, dark current, defects, cosmic
/// rays, blooming. Terms after EMVA 1288, release 4.0.
///
/// A photosite with a mean of `m` photoelectrons collects Poisson(PRNU gain * m + dark current * exposure time);
/// cosmic rays add charge; above the full well charge is lost, or blooms along the column. The offset (DSNU) and
/// read noise are added, and the converter follows as in detector.h. The same mean draws the same noise as in
/// detector.h.
///
/// Fixed patterns depend only on (seed, camera name); blinking and cosmic rays also on the frame number.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/counter_random.h"
#include "base/radiance_image.h"
#include "renderer/scene/scene.h"

namespace narpa {

struct DetectorConstants;
struct SiteConstants;

/// A defective photosite.
struct DefectSite {
    enum class Kind : std::uint8_t { dead, hot, blinking };
    std::uint32_t site;
    Kind kind;
};

class SensorArray {
public:
    /// Draws the patterns and allocates the charge buffer. Null if the detector has none of these effects.
    [[nodiscard]] static std::unique_ptr<SensorArray> create(const Camera& camera, std::uint64_t seed);

    /// `expose` of detector.h, for the camera that this array was created for (its exposure, temperature and noise
    /// may change). Allocates nothing.
    void expose(const Camera& camera, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
                std::span<std::uint8_t> out) noexcept;

private:
    SensorArray(const Camera& camera, std::uint64_t seed);
    void draw_patterns(const Detector& detector);
    void draw_defects(const Detector& detector);
    [[nodiscard]] SiteConstants constants(const Detector& detector, const DetectorConstants& sensor,
                                          std::uint32_t frame) const noexcept;

    void move_charge(const Camera& camera, std::uint32_t frame, float full_well_e) noexcept;

    PhiloxSchedule random_;
    std::uint32_t bands_;              ///< photosites of a pixel
    std::size_t sites_of_band_;        ///< padded to whole batches
    std::vector<float> gain_;          ///< PRNU; empty: 1 everywhere
    std::vector<float> offset_;        ///< DSNU, in standard deviations; empty: 0 everywhere
    std::vector<DefectSite> defects_;  ///< in the order of their sites
    std::vector<float> charge_e_;      ///< of each photosite; empty unless charge moves between them
};

}  // namespace narpa
