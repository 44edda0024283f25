/// emulator/replay.h - the frames of a logged run once more: what the budget of each cost.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/image_compare.h"
#include "emulator/world.h"
#include "renderer/trace/frame_budget.h"

namespace narpa {

/// What a camera's ledger log says of how a frame was made.
struct LoggedFrame {
    std::uint32_t frame = 0;
    std::int64_t t_mid_ns = 0;
    int spp = 1;  ///< where there was no budget
    FrameStep step = FrameStep::refined;
    std::array<std::uint32_t, kMaxPasses> passes{};
    double expected_error = 0;  ///< of the full scale; 0: not estimated
};
/// Reads CAMERA.ledger.csv, whatever the order of its columns. Errors name file, line and column.
Result<std::vector<LoggedFrame>> read_ledger_log(const std::string& path);

/// A logged run of one camera, open to be looked at again.
class Replay {
public:
    /// `scene_file` empty: the one that the run had.
    static Result<std::unique_ptr<Replay>> open(const std::string& folder, const std::string& camera,
                                                const std::string& scene_file);
    ~Replay();

    [[nodiscard]] const std::vector<LoggedFrame>& frames() const noexcept;
    [[nodiscard]] const World& world() const noexcept;
    [[nodiscard]] const Camera& camera() const noexcept;

    /// Makes frame i of the log as it was made, sample for sample. Frames are asked for in the order of the log.
    Status make(std::size_t i);
    [[nodiscard]] const RadianceImage& picture() const noexcept;
    /// How far it is from the same view with `spp` samples for each pixel, of other random numbers than the run's.
    [[nodiscard]] ImageDifference against(int spp);

private:
    struct Impl;
    explicit Replay(std::unique_ptr<Impl>);
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
