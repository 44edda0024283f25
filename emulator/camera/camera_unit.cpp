#include "emulator/camera/camera_unit.h"

#include <cmath>

#include "emulator/clock.h"
#include "protocols/video/embedded_line.h"
#include "protocols/video/test_pattern.h"
#include "renderer/camera/read_out.h"
#include "renderer/detector/detector.h"

namespace narpa {

static_assert(FrameLedger::kPasses == kMaxPasses);
static_assert(kStepNames.size() == static_cast<std::size_t>(FrameStep::sparse) + 1);

double full_scale_radiance(const Camera& camera) noexcept {
    if (!camera.detector) return camera.white_radiance;
    const Detector& d = *camera.detector;
    double electrons = 0;
    for (int band = 0; band < 3; ++band) electrons += electrons_per_radiance(d, band);
    const double top_e = gain_e_per_dn(d) * (std::exp2(d.bits) - 1 - d.black_level_dn);
    return std::min(d.full_well_e, top_e) / (is_mono(camera.format) ? electrons : electrons / 3);
}

CameraPose camera_pose(const World& world, const Camera& camera, const BodyPoses& at, std::int64_t start_ns,
                       std::int64_t end_ns, std::span<const Motion> motions) noexcept {
    const auto at_time = [&](double time) {
        const double t_ns = static_cast<double>(start_ns) + time * static_cast<double>(end_ns - start_ns);
        return world.camera_pose(camera, 1e-9 * t_ns, at, time);
    };
    CameraPose pose = at_time(kMidExposure);
    if (camera.shutter) {
        const auto row_ns = static_cast<double>(camera.shutter->row_time_ns);
        pose = {at_time(0), at_time(1), row_ns / static_cast<double>(end_ns - start_ns)};
    }
    pose.set_clock(1e-9 * static_cast<double>(start_ns), 1e-9 * static_cast<double>(end_ns),
                   camera.mount < 0 ? Vec3{} : motions[static_cast<std::size_t>(camera.mount)].velocity_m_s);
    return pose;
}

CameraUnit::CameraUnit(const World& world, std::size_t index)
    : world_(world),
      camera_(world.scene().cameras[index]),
      index_(static_cast<std::uint8_t>(index)),
      settings_(settings_of(camera_)),
      full_scale_(full_scale_radiance(camera_)),
      placement_(world.scene().bodies.size()),
      motions_(world.scene().bodies.size()),
      starts_(camera_.shutter ? motions_.size() : 0),
      ends_(starts_.size()),
      renderer_(world.render_scene(), camera_),
      array_seed_(world.scene().render.seed),
      sensor_array_(SensorArray::create(camera_, array_seed_)),
      radiance_(camera_.width, camera_.height),
      bytes_(frame_bytes(format())) {
    if (camera_.control) set(settings_, 0);  // whole nanoseconds, as logs have them
}

VideoFormat CameraUnit::format() const noexcept {
    return {camera_.width, camera_.height, camera_.format, camera_.period_ns};
}

void CameraUnit::set(const CameraSettings& settings, std::uint8_t command_counter) noexcept {
    settings_ = settings;
    command_counter_ = command_counter;
    apply(settings, world_.scene().cameras[index_], camera_);
    full_scale_ = full_scale_radiance(camera_);
}

void CameraUnit::set_mount(int mount, const Rigid3& T_mount_camera) noexcept {
    camera_.mount = mount;
    camera_.T_mount_camera = T_mount_camera;
    camera_.course = nullptr;
}

FrameBudget CameraUnit::budget(std::int64_t deadline_ns) const noexcept {
    const RenderSettings& render = world_.scene().render;
    FrameBudget budget;
    if (render.budget_rays > 0) {
        budget.kind = FrameBudget::Kind::rays;
        budget.rays = render.budget_rays;
    } else if (render.budget_ns > 0) {
        budget.kind = FrameBudget::Kind::time;
        budget.deadline_ns = deadline_ns - std::min(allowance_.ns(), render.budget_ns / 2);
    } else if (deadline_ns > 0 && render.keep_deadline) {
        budget.kind = FrameBudget::Kind::aim;
        budget.deadline_ns = deadline_ns - std::min(allowance_.ns(), camera_.period_ns / 2);
    }
    return budget;
}

FrameLedger CameraUnit::expose(std::uint32_t frame, std::int64_t t_mid_ns, std::int64_t deadline_ns, Aovs* aovs,
                               std::atomic<std::size_t>* pixels_done) {
    return expose(frame, t_mid_ns, budget(deadline_ns), aovs, pixels_done);
}

void CameraUnit::warm_up() {
    FrameBudget all = budget(monotonic_ns());
    if (all.kind == FrameBudget::Kind::aim)  // measures what `spp` takes
        embed(expose(0, 0, FrameBudget{}, nullptr, nullptr));
    if (all.kind != FrameBudget::Kind::samples) {
        const auto pixels = static_cast<std::uint32_t>(radiance_.pixels.size());
        FrameBudget coarse;  // measures what a frame takes that has less than one sample per pixel
        coarse.kind = FrameBudget::Kind::passes;
        coarse.step = static_cast<std::uint8_t>(FrameStep::coarse_2);
        coarse.passes[0] = pixels;
        embed(expose(0, 0, coarse, nullptr, nullptr));
        all.kind = FrameBudget::Kind::passes;
        all.step = static_cast<std::uint8_t>(FrameStep::refined);
        all.passes[0] = all.passes[kSunlightPass] = pixels;
    }
    embed(expose(0, 0, all, nullptr, nullptr));
}

FrameLedger CameraUnit::expose(std::uint32_t frame, std::int64_t t_mid_ns, const FrameBudget& budget, Aovs* aovs,
                               std::atomic<std::size_t>* pixels_done) {
    const PlacementSource source = world_.place(t_mid_ns, camera_.mount, placement_, motions_);
    const std::int64_t start_ns = t_mid_ns - exposure_ns() / 2, end_ns = start_ns + exposure_ns();
    if (camera_.shutter) {
        world_.place(start_ns, camera_.mount, placement_, starts_);
        world_.place(end_ns, camera_.mount, placement_, ends_);
        for (std::size_t i = 0; i < starts_.size(); ++i)
            placement_.set(i, starts_[i].T_world_body, ends_[i].T_world_body);
        world_.tracer().arrange(placement_);
    }
    const FrameAccount account = camera_.test_pattern == TestPattern::none
                                     ? take_image(frame, start_ns, end_ns, budget, aovs, pixels_done)
                                     : put_test_pattern(frame);

    FrameLedger ledger;
    ledger.frame = frame;
    ledger.camera = index_;
    ledger.pose_counter = source.counter;
    ledger.pose_stale = source.stale;
    ledger.t_pose_ns = source.t_pose_ns;
    put_cost(account, ledger);
    ledger.command_counter = command_counter_;
    ledger.trigger = settings_.trigger;
    ledger.gain_cdb = settings_.gain_cdb;
    ledger.binning = settings_.binning;
    ledger.region_x = settings_.region.x, ledger.region_y = settings_.region.y;
    ledger.region_width = settings_.region.width, ledger.region_height = settings_.region.height;
    ledger.t_exposure_mid_ns = t_mid_ns;
    ledger.t_exposure_start_ns = start_ns;
    ledger.t_exposure_end_ns = end_ns;
    return ledger;
}

FrameAccount CameraUnit::put_test_pattern(std::uint32_t frame) noexcept {
    t_radiance_ns_ = monotonic_ns();
    const int bits = camera_.detector ? camera_.detector->bits : 16;
    const auto fill = camera_.test_pattern == TestPattern::counter ? fill_counter : fill_prbs;
    fill(camera_.format, bits, frame, bytes_);
    durations_ = {.radiance_ns = 0, .sensor_ns = monotonic_ns() - t_radiance_ns_};
    return {};
}

FrameAccount CameraUnit::take_image(std::uint32_t frame, std::int64_t start_ns, std::int64_t end_ns,
                                    const FrameBudget& budget, Aovs* aovs, std::atomic<std::size_t>* pixels_done) {
    const RenderSettings& render = world_.scene().render;
    const CameraPose pose = camera_pose(world_, camera_, placement_, start_ns, end_ns, motions_);
    const std::int64_t begun_ns = monotonic_ns();
    FrameSettings settings;
    settings.spp = render.spp;
    settings.seed = seed_of_camera(render.seed, index_);
    settings.frame = frame;
    settings.method = render.method;
    settings.max_depth = render.max_depth;
    settings.pixels_done = pixels_done;
    settings.budget = budget;
    const FrameAccount account = renderer_.render(placement_, pose, settings, radiance_, aovs);
    t_radiance_ns_ = monotonic_ns();
    durations_.radiance_ns = t_radiance_ns_ - begun_ns;
    const std::int64_t lit_ns = t_radiance_ns_;
    if (render.seed != array_seed_) {  // World::set_render
        array_seed_ = render.seed;
        sensor_array_ = SensorArray::create(camera_, array_seed_);
    }
    // The allowance includes the time by which the renderer stopped late, unless no less could be done.
    if (account.timed && !account.coarsest_late)
        t_radiance_ns_ = std::min(t_radiance_ns_, settings.budget.deadline_ns);
    narpa::expose(camera_, radiance_, settings.seed, frame, bytes_, sensor_array_.get());
    if (camera_.control) read_out(format(), settings_.region, settings_.binning, bytes_);
    durations_.sensor_ns = monotonic_ns() - lit_ns;
    return account;
}

void CameraUnit::put_cost(const FrameAccount& account, FrameLedger& ledger) const noexcept {
    const RenderSettings& render = world_.scene().render;
    if (render.budget_rays > 0) {
        ledger.budget_kind = BudgetKind::rays;
        ledger.budget = render.budget_rays;
    } else if (render.budget_ns > 0) {
        ledger.budget_kind = BudgetKind::time;
        ledger.budget = static_cast<std::uint64_t>(render.budget_ns);
    } else if (account.timed) {
        ledger.budget_kind = BudgetKind::time;
        ledger.budget = static_cast<std::uint64_t>(camera_.period_ns);
    } else {
        ledger.budget = static_cast<std::uint64_t>(render.spp);
    }
    ledger.step = static_cast<std::uint8_t>(account.step);
    ledger.samples = account.samples;
    ledger.rays = account.rays;
    ledger.passes = account.passes;
    const auto pixels = static_cast<double>(radiance_.pixels.size());
    ledger.samples_per_pixel = static_cast<float>(static_cast<double>(account.samples) / pixels);
    if (account.standard_error >= 0)
        ledger.expected_error = static_cast<float>(account.standard_error / full_scale_);
}

void CameraUnit::embed(const FrameLedger& ledger) noexcept {
    if (!camera_.embedded_line) return;
    const std::size_t row = bytes_.size() / static_cast<std::size_t>(camera_.height);
    (void)encode_embedded_line(ledger, std::span(bytes_).last(row));  // World::create refuses rows too narrow
}

}  // namespace narpa
