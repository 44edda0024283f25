/// emulator/replay/replay.h - renders the frames of a logged run again, bit for bit, and measures what their
/// budgets cost.
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

/// Difference from a render with many samples per pixel.
struct ReferenceComparison {
    ImageDifference difference;
    double reference_error = 0;  ///< the reference's own standard error, W m^-2 sr^-1
};

/// A logged run of one camera.
///
/// A frame follows from the scene, the bodies' poses, its number, the seed, its step and the sizes of its passes
/// (renderer/integrator/frame_settings.h). The log has them all, so frames with a time budget repeat too.
class Replay {
public:
    /// `camera` empty: the first of the scene. `scene_file` empty: the run's own.
    static Result<std::unique_ptr<Replay>> open(const std::string& folder, const std::string& camera,
                                                const std::string& scene_file);
    ~Replay();

    [[nodiscard]] const std::vector<LoggedFrame>& frames() const noexcept;
    [[nodiscard]] const World& world() const noexcept;
    [[nodiscard]] const Camera& camera() const noexcept;
    [[nodiscard]] std::size_t camera_index() const noexcept;
    /// Body poses of frame i.
    [[nodiscard]] const BodyPoses& placement(std::size_t i) const noexcept;

    /// Whether frame i has an image of its own; false if not even the coarsest step was rendered.
    [[nodiscard]] bool has_image(std::size_t i) const noexcept;

    /// Renders frame i again. Returns the differences from the log as text: empty if the frame repeats bit for bit,
    /// or has no image and cost nothing.
    std::vector<std::string> make(std::size_t i);
    [[nodiscard]] const RadianceImage& picture() const noexcept;
    /// The last frame rendered, in the device's format.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept;

    /// Compares the last frame rendered with `spp` samples per pixel of other random numbers.
    ReferenceComparison against(int spp);
    [[nodiscard]] const RadianceImage& reference() const noexcept;

private:
    struct Impl;
    explicit Replay(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
