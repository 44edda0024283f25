/// apps/frame_renderer.h - renders frames of one camera of a scene to image files.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "apps/cli.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/threads.h"
#include "renderer/camera/signal_levels.h"

namespace narpa::cli {

/// A frame of a series, or the only one.
struct FrameRequest {
    std::int64_t t_ns = 0;
    std::uint32_t frame = 0;
    std::string out;  ///< as write_image takes it
};

class FrameRenderer {
public:
    /// `outputs`: names of Aovs for the image file. `threads` outlives it.
    static Result<std::unique_ptr<FrameRenderer>> create(Scene scene, std::size_t camera,
                                                         std::set<std::string> outputs, TracingThreads& threads);

    [[nodiscard]] World& world() { return *world_; }
    /// Writes the file; returns its part of the document.
    Outcome render(const FrameRequest& request);

private:
    FrameRenderer(std::unique_ptr<World> world, std::size_t camera, std::set<std::string> outputs,
                  TracingThreads& threads);
    [[nodiscard]] const RenderSettings& settings() const { return world_->scene().render; }
    [[nodiscard]] std::int64_t budget_ns() const { return settings().budget_ns; }
    std::int64_t prepare(const FrameRequest& request);
    void warn_of(const SignalLevels& levels) const;
    void print(const FrameRequest& request, const FrameLedger& ledger, double seconds) const;
    [[nodiscard]] nlohmann::json document(const FrameRequest& request, const FrameLedger& ledger,
                                          const SignalLevels& levels, double seconds) const;

    std::unique_ptr<World> world_;
    CameraUnit unit_;
    std::set<std::string> outputs_;
    TracingThreads& threads_;
    bool calibrated_ = false;
};

}  // namespace narpa::cli
