/// python/module/scene_session.h - a scene that is rendered and scanned again and again: what narpa.Scene does,
/// without Python. Renderers and buffers are made once and reused.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/sweep_log.h"
#include "emulator/threads.h"
#include "emulator/world.h"

namespace narpa::python {

struct RenderRequest {
    std::string camera;  ///< name; empty: the first
    double time_s = 0;
    std::optional<std::uint32_t> frame;  ///< empty: the one nearest to the time
    std::optional<int> spp;              ///< in place of the scene's samples or budget
    std::optional<std::uint64_t> seed;   ///< in place of the scene's
    bool with_aovs = false;
};

/// A frame that belongs to the caller.
struct RenderedImage {
    Camera camera;
    FrameLedger ledger;
    std::vector<Rgb> radiance;
    std::vector<std::uint8_t> bytes;  ///< as of the device, in the camera's format
    Aovs aovs;
};

/// Functions of one session may be called from any threads; they take turns.
class SceneSession {
public:
    /// `threads`: that trace rays; 0: one per core.
    static Result<std::unique_ptr<SceneSession>> create(Scene scene, int threads);

    [[nodiscard]] const Scene& scene() const noexcept { return world_->scene(); }

    /// Sets a body's motion from time 0 on. Errors: no such body; an attitude that is no rotation.
    Status place(const std::string& body, const Motion& motion);
    /// Mounts a camera on a body, or on the world ("").
    Status place_camera(const std::string& camera, const std::string& mount, const Rigid3& T_mount_camera);
    [[nodiscard]] Result<Rigid3> T_world_body(const std::string& body, double time_s);
    [[nodiscard]] Result<Rigid3> T_world_camera(const std::string& camera, double time_s);

    /// The frame that `narpa render` writes.
    Result<RenderedImage> render(const RenderRequest& request);
    /// The shots that `narpa scan -o FILE.csv` writes. `duration_s` 0: one turn.
    Result<std::vector<ShotRow>> scan(const std::string& lidar, double time_s, double duration_s);

    /// Calls `work(world)` on the tracing threads, alone.
    template <class Work>
    auto with_world(const Work& work) {
        const std::scoped_lock lock(mutex_);
        return threads_.arena.execute([&] { return work(std::as_const(*world_)); });
    }

private:
    SceneSession(std::unique_ptr<World> world, int threads);
    CameraUnit& unit_of(std::size_t camera);
    [[nodiscard]] Result<std::size_t> body_of(const std::string& name) const;

    std::mutex mutex_;
    TracingThreads threads_;
    std::unique_ptr<World> world_;
    const RenderSettings settings_;  ///< of the scene's file
    std::map<std::size_t, std::unique_ptr<CameraUnit>> cameras_;
    std::map<std::size_t, std::unique_ptr<LidarUnit>> lidars_;
};

/// Simulation time in ns. Errors: not finite, or beyond 9e9 s.
[[nodiscard]] Result<std::int64_t> to_ns(double time_s);

}  // namespace narpa::python
