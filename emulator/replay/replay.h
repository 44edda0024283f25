/// emulator/replay/replay.h - renders the frames of a logged run again, bit for bit, and measures what their
/// budgets cost.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/log/ledger_log.h"
#include "emulator/replay/image_compare.h"
#include "emulator/world.h"
#include "renderer/detector/sensor_array.h"

namespace narpa {

/// Difference from a render with many samples per pixel.
struct ReferenceComparison {
    ImageDifference difference;
    double reference_error = 0;  ///< the reference's own standard error, W m^-2 sr^-1
};

/// A logged run of one camera.
///
/// A frame follows from the scene, the bodies' poses, its number, the seed, its step and the sizes of its passes
/// (renderer/frame/frame_settings.h). The log has them all, so frames with a time budget repeat too.
class Replay {
public:
    /// `camera` empty: the first of the scene. `scene_file` empty: the run's own.
    static Result<std::unique_ptr<Replay>> open(const std::string& folder, const std::string& camera,
                                                const std::string& scene_file);

    /// Files of the scene that have changed since the run; empty for another scene than the run's.
    [[nodiscard]] const std::vector<std::string>& changed_files() const noexcept { return changed_files_; }
    [[nodiscard]] const std::vector<LoggedFrame>& frames() const noexcept { return frames_; }
    [[nodiscard]] const World& world() const noexcept { return *world_; }
    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] std::size_t camera_index() const noexcept { return index_; }
    /// Body poses of frame i.
    [[nodiscard]] const BodyPoses& placement(std::size_t i) const noexcept { return placements_[i]; }

    /// Whether frame i has an image of its own; false if not even the coarsest step was rendered.
    [[nodiscard]] bool has_image(std::size_t i) const noexcept {
        return static_cast<FrameStep>(frames_[i].ledger.step) != FrameStep::nothing;
    }

    /// Renders frame i again. Returns the differences from the log as text: empty if the frame repeats bit for bit,
    /// or has no image and cost nothing.
    std::vector<std::string> make(std::size_t i);
    [[nodiscard]] const RadianceImage& picture() const noexcept { return picture_; }
    /// The last frame rendered, in the device's format.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }

    /// Compares the last frame rendered with `spp` samples per pixel of other random numbers.
    ReferenceComparison against(int spp);
    [[nodiscard]] const RadianceImage& reference() const noexcept { return reference_; }

private:
    Replay(std::unique_ptr<World> world, std::size_t camera_index);
    void set(const FrameLedger& ledger);
    [[nodiscard]] FrameSettings settings_of(std::size_t i) const;
    [[nodiscard]] bool bytes_repeat(const LoggedFrame& logged);

    std::unique_ptr<World> world_;
    Camera camera_;  ///< as it was set for the frame
    std::uint8_t index_;
    CameraSettings settings_;
    double full_scale_;
    std::vector<LoggedFrame> frames_;
    std::vector<std::string> changed_files_;
    std::vector<BodyPoses> placements_;  ///< of each frame
    std::vector<CameraPose> poses_;
    CameraRenderer renderer_;
    std::unique_ptr<SensorArray> sensor_array_;
    RadianceImage picture_, reference_;
    std::vector<std::uint8_t> bytes_;
    std::size_t made_ = 0;  ///< the frame that `picture_` shows
};

}  // namespace narpa
