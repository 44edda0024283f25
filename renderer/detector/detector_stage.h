/// renderer/detector/detector_stage.h - the stages of a detector that scenes may name, one row each.
///
/// A new stage is a DetectorStage in a file of its own, with its row, and a line in detector_stages.cpp. Light
/// becomes digital numbers in this order (EMVA 1288, release 4.0, linear model):
///
///   1. light releases a mean charge in each photosite, times its gain    FixedPatterns::gain
///   2. dark current and defects change the mean                          SiteAmounts, FixedPatterns::defects
///   3. shot noise
///   4. charge from elsewhere is added                                    Place::collection
///   5. charge moves between photosites                                   Place::transfer
///   6. charge above the full well is lost
///   7. the read-out changes the signal                                   Place::read_out
///   8. the photosite's offset and read noise are added                   FixedPatterns::offset
///   9. the converter rounds and clamps
///
/// One loop over batches of photosites (collect.h) has 1 to 3, 6, 8 and 9. A stage with a Place acts on the charge
/// of a whole band; without any such stage that charge is not stored.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/counter_random.h"
#include "renderer/detector/detector_settings.h"
#include "renderer/keys/keys.h"

namespace narpa {

class TableReader;

/// Philox counter values of fixed patterns and events, one for each use.
struct SensorDraw {
    static constexpr std::uint32_t kPattern = 0, kDefects = 1, kBlinking = 2, kHits = 4;  ///< hits: 3 of each band
    static constexpr std::uint32_t kFree = 16;  ///< this and higher ones have no use yet
};

/// A defective photosite.
struct DefectSite {
    enum class Kind : std::uint8_t { dead, hot, blinking };
    std::uint32_t site;
    Kind kind;
};

/// Differences between photosites, the same in every frame. Photosites of one band follow each other, row by row,
/// padded to whole batches; then the next band's.
struct FixedPatterns {
    std::size_t sites = 0;              ///< of all bands
    std::vector<float> gain{};          ///< empty: 1 everywhere
    std::vector<float> offset{};        ///< in units of SiteAmounts::dsnu_e; empty: 0 everywhere
    std::vector<DefectSite> defects{};  ///< in the order of their sites
};

/// Amounts that the photosites have in common.
struct SiteAmounts {
    double dark_e = 0;                 ///< mean charge of one exposure's dark current, without defects
    double hot_e = 0, blinking_e = 0;  ///< mean charge that defects add to it
    double prnu = 0, dsnu_e = 0;       ///< standard deviations of gains and offsets: PRNU_1288, DSNU_1288
};

/// The charge of one band in one frame.
struct ChargePlane {
    const ImageSensor& sensor;
    const PhiloxSchedule& random;  ///< of the seed and the camera's name
    std::uint32_t frame = 0, band = 0;
    float full_well_e = 0;
    std::span<float> charge_e;  ///< row by row, sensor.height x sensor.width, and padding
};

/// Functions that a stage does not need do nothing. Those of a frame neither allocate nor throw.
class DetectorStage {
public:
    enum class Place : std::uint8_t { none, collection, transfer, read_out };

    virtual ~DetectorStage() = default;
    /// At the start.
    virtual void draw(const PhiloxSchedule& random, FixedPatterns& patterns) const;
    /// Of one exposure; the detector's exposure, gain and temperature may change between frames.
    virtual void add_to(SiteAmounts& amounts, const Detector& detector) const noexcept;
    /// Where it acts on the charge of a whole band, if it does.
    [[nodiscard]] virtual Place place() const noexcept { return Place::none; }
    /// In its place, on the calling thread's TBB arena: the same bytes on any number of threads.
    virtual void act(const ChargePlane& plane) const noexcept;
};

struct DetectorStageKind {
    std::span<const TableKey> keys{};                                ///< of [camera.detector]
    void (*read)(TableReader& table, Detector& detector) = nullptr;  ///< adds the stage if the scene names it
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const DetectorStageKind* const> detector_stage_kinds();

extern const TableKeys kDetectorKeys;
/// [camera.detector] of a camera with this time between frames; nullopt if it has none.
std::optional<Detector> read_detector(TableReader& camera, std::int64_t period_ns,
                                      std::span<const DetectorStageKind* const> kinds = detector_stage_kinds());

/// The sum of the detector's stages.
[[nodiscard]] SiteAmounts site_amounts(const Detector& detector) noexcept;

}  // namespace narpa
