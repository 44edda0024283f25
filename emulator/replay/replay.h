/// emulator/replay/replay.h - the frames of a logged run once more, bit for bit, and what the budget of each cost.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/log/ledger_log.h"
#include "emulator/replay/image_compare.h"
#include "emulator/world.h"

namespace narpa {

/// The same view with many samples for each pixel.
struct ReferenceComparison {
    ImageDifference difference;
    double reference_error = 0;  ///< the reference's own standard error, W m^-2 sr^-1
};

/// A logged run of one camera, open to be looked at again.
///
/// A frame follows from the scene, the bodies' poses, its number, the seed, its step and the sizes of its passes
/// (renderer/integrator/frame_budget.h): the log has them all, so that frames made against the clock repeat as well.
class Replay {
public:
    /// `camera` empty: the first of the scene. `scene_file` empty: the one that the run had.
    static Result<std::unique_ptr<Replay>> open(const std::string& folder, const std::string& camera,
                                                const std::string& scene_file);
    ~Replay();

    [[nodiscard]] const std::vector<LoggedFrame>& frames() const noexcept;
    [[nodiscard]] const World& world() const noexcept;
    [[nodiscard]] const Camera& camera() const noexcept;
    [[nodiscard]] std::size_t camera_index() const noexcept;
    /// Where the bodies were in frame i.
    [[nodiscard]] const BodyPoses& placement(std::size_t i) const noexcept;

    /// Whether frame i has an image of its own: one that did not even get to its coarsest step has none to repeat.
    [[nodiscard]] bool has_image(std::size_t i) const noexcept;

    /// Makes frame i as it was made. Returns what is not as the log tells, in words: nothing where the frame
    /// repeats bit for bit, or has no image and took nothing.
    std::vector<std::string> make(std::size_t i);
    [[nodiscard]] const RadianceImage& picture() const noexcept;
    /// The frame made last as the device would take it.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept;

    /// Compares the frame made last with `spp` samples for each pixel, of other random numbers than the run's.
    ReferenceComparison against(int spp);
    [[nodiscard]] const RadianceImage& reference() const noexcept;

private:
    struct Impl;
    explicit Replay(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
