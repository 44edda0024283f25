#include "emulator/camera_unit.h"

#include "protocols/video/embedded_line.h"
#include "renderer/sensor/detector.h"

namespace narpa {

CameraUnit::CameraUnit(const World& world, std::size_t index)
    : world_(world),
      camera_(world.scene().cameras[index]),
      index_(static_cast<std::uint8_t>(index)),
      placement_(world.scene().bodies.size()),
      radiance_(camera_.width, camera_.height),
      bytes_(frame_bytes(format())) {}

VideoFormat CameraUnit::format() const noexcept {
    return {camera_.width, camera_.height, camera_.format, camera_.period_ns};
}

std::int64_t CameraUnit::exposure_ns() const noexcept {
    return camera_.detector ? static_cast<std::int64_t>(camera_.detector->exposure_s * 1e9) : 0;
}

FrameLedger CameraUnit::expose(std::uint32_t frame, std::int64_t t_mid_ns, Aovs* aovs,
                               std::atomic<std::size_t>* pixels_done) {
    const RenderSettings& render = world_.scene().render;
    const PlacementSource source = world_.place(t_mid_ns, camera_.mount, placement_);
    const Rigid3 T_world_camera = world_.sensor_pose(camera_.mount, camera_.T_mount_camera, placement_);
    const FrameSettings settings{render.spp, render.seed, frame, render.method, render.max_depth, pixels_done};
    render_radiance(world_.tracer(), placement_, camera_, T_world_camera, settings, radiance_, aovs);
    narpa::expose(camera_, radiance_, render.seed, frame, bytes_);

    FrameLedger ledger;
    ledger.frame = frame;
    ledger.camera = index_;
    ledger.pose_counter = source.counter;
    ledger.pose_stale = source.stale;
    ledger.t_pose_ns = source.t_pose_ns;
    ledger.samples_per_pixel = static_cast<std::uint16_t>(render.spp);
    ledger.t_exposure_mid_ns = t_mid_ns;
    ledger.t_exposure_start_ns = t_mid_ns - exposure_ns() / 2;
    ledger.t_exposure_end_ns = ledger.t_exposure_start_ns + exposure_ns();
    return ledger;
}

void CameraUnit::embed(const FrameLedger& ledger) noexcept {
    if (!camera_.embedded_line) return;
    const std::size_t row = bytes_.size() / static_cast<std::size_t>(camera_.height);
    (void)encode_embedded_line(ledger, std::span(bytes_).last(row));  // World::create refuses rows too narrow
}

}  // namespace narpa
