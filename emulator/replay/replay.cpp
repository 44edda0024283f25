#include "emulator/replay/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "emulator/camera_unit.h"
#include "emulator/log/run_record.h"
#include "protocols/video/embedded_line.h"
#include "renderer/camera/detector.h"
#include "renderer/scene/scene_file.h"

namespace narpa {
namespace {

/// Where the bodies were in each of the frames, in the frames' order.
Result<std::vector<BodyPoses>> placements_of(const std::vector<LoggedFrame>& frames, const World& world,
                                             const std::string& ledger_file, const std::string& truth_file) {
    auto rows = read_trajectory(truth_file);
    if (!rows) return rows.error();
    const auto by_time = [](const TrajectoryRow& a, const TrajectoryRow& b) { return a.t_ns < b.t_ns; };
    std::stable_sort(rows->begin(), rows->end(), by_time);
    const std::size_t bodies = world.scene().bodies.size();
    std::vector<BodyPoses> placements;
    placements.reserve(frames.size());
    for (const LoggedFrame& frame : frames) {
        const std::int64_t t_ns = frame.ledger.t_exposure_mid_ns;
        const auto [begin, end] =
            std::equal_range(rows->begin(), rows->end(), TrajectoryRow{t_ns, {}, {}, 0}, by_time);
        BodyPoses& at = placements.emplace_back(bodies);
        for (auto row = begin; row != end; ++row) {
            const auto body = world.body_named(row->body);
            if (!body)
                return Error{fmt::format("body \"{}\" at {:.9f} s, which the scene \"{}\" does not have", row->body,
                                         static_cast<double>(t_ns) * 1e-9, world.scene().file),
                             truth_file, row->line};
            at.set(*body, row->motion.T_world_body);
        }
        if (static_cast<std::size_t>(end - begin) != bodies)
            return Error{fmt::format("frame {} at {} ns: {} holds {} poses for this time, expected {}",
                                     frame.ledger.frame, t_ns, truth_file, end - begin, bodies),
                         ledger_file, frame.line, 1};
    }
    return placements;
}

/// "rays: 512, logged 513", where they are not the same.
template <class Value>
void expect_same(std::string_view what, const Value& now, const Value& logged, std::vector<std::string>& differs) {
    if (now != logged) differs.push_back(fmt::format("{}: {}, logged {}", what, now, logged));
}

}  // namespace

struct Replay::Impl {
    Impl(std::unique_ptr<World> w, std::size_t camera_index)
        : world(std::move(w)),
          camera(world->scene().cameras[camera_index]),
          index(static_cast<std::uint8_t>(camera_index)),
          full_scale(full_scale_radiance(camera)),
          renderer(world->render_scene(), camera),
          picture(camera.width, camera.height),
          reference(camera.width, camera.height),
          bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns})) {}

    [[nodiscard]] FrameSettings settings_of(std::size_t i) const;
    [[nodiscard]] Rigid3 T_world_camera(std::size_t i) const {
        return world->sensor_pose(camera.mount, camera.T_mount_camera, placements[i]);
    }
    [[nodiscard]] bool bytes_repeat(const LoggedFrame& logged);

    std::unique_ptr<World> world;
    const Camera& camera;
    std::uint8_t index;
    double full_scale;
    std::vector<LoggedFrame> frames;
    std::vector<BodyPoses> placements;
    CameraRenderer renderer;
    RadianceImage picture, reference;
    Aovs middles;
    std::vector<std::uint8_t> bytes;
    std::size_t made = 0;  ///< the frame that `picture` shows
};

Result<std::unique_ptr<Replay>> Replay::open(const std::string& folder, const std::string& camera,
                                             const std::string& scene_file) {
    const auto record = read_run_record(folder);
    if (!record) return record.error();
    auto scene = read_scene(scene_file.empty() ? record->scene_file : scene_file);
    if (!scene) return scene.error();
    if (auto good = use_method(*scene, record->method); !good) return good.error();
    scene->render.max_depth = record->max_depth;
    scene->render.seed = record->seed;
    const auto index = sensor_named(scene->cameras, camera, "camera", scene->file);
    if (!index) return index.error();
    const std::string stem = folder + "/" + scene->cameras[*index].name;
    auto frames = read_ledger_log(stem + ".ledger.csv");
    if (!frames) return frames.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    auto placements = placements_of(*frames, **world, stem + ".ledger.csv", stem + ".truth.csv");
    if (!placements) return placements.error();
    auto impl = std::make_unique<Impl>(*std::move(world), *index);
    impl->frames = *std::move(frames);
    impl->placements = *std::move(placements);
    return std::unique_ptr<Replay>(new Replay(std::move(impl)));
}

Replay::Replay(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Replay::~Replay() = default;

const std::vector<LoggedFrame>& Replay::frames() const noexcept {
    return impl_->frames;
}
const World& Replay::world() const noexcept {
    return *impl_->world;
}
const Camera& Replay::camera() const noexcept {
    return impl_->camera;
}
std::size_t Replay::camera_index() const noexcept {
    return impl_->index;
}
const BodyPoses& Replay::placement(std::size_t i) const noexcept {
    return impl_->placements[i];
}
std::span<const std::uint8_t> Replay::bytes() const noexcept {
    return impl_->bytes;
}
const RadianceImage& Replay::picture() const noexcept {
    return impl_->picture;
}
const RadianceImage& Replay::reference() const noexcept {
    return impl_->reference;
}
bool Replay::has_image(std::size_t i) const noexcept {
    return static_cast<FrameStep>(impl_->frames[i].ledger.step) != FrameStep::nothing;
}

FrameSettings Replay::Impl::settings_of(std::size_t i) const {
    const FrameLedger& logged = frames[i].ledger;
    const RenderSettings& render = world->scene().render;
    FrameSettings s;
    s.seed = render.seed;
    s.frame = logged.frame;
    s.method = render.method;
    s.max_depth = render.max_depth;
    if (logged.budget_kind == BudgetKind::samples) {
        s.spp = static_cast<int>(logged.budget);
    } else {
        s.budget.kind = FrameBudget::Kind::passes;
        s.budget.passes = logged.passes;
        s.budget.step = logged.step;
    }
    return s;
}

std::vector<std::string> Replay::make(std::size_t i) {
    Impl& r = *impl_;
    const LoggedFrame& logged = r.frames[i];
    const FrameSettings settings = r.settings_of(i);
    const FrameAccount account = r.renderer.render(r.placements[i], r.T_world_camera(i), settings, r.picture);
    r.made = i;

    std::vector<std::string> differs;
    const FrameLedger& l = logged.ledger;
    expect_same("step", kStepNames[static_cast<std::size_t>(account.step)], kStepNames[l.step], differs);
    expect_same("samples", account.samples, l.samples, differs);
    expect_same("rays", account.rays, l.rays, differs);
    if (!has_image(i) && l.passes[0] > 0) differs.push_back(fmt::format("passes: none, logged {}", l.passes[0]));
    // A frame that had no time left to estimate its error has time here.
    if (l.expected_error >= 0)
        expect_same("expected_error", static_cast<float>(account.standard_error / r.full_scale), l.expected_error,
                    differs);
    expose(r.camera, r.picture, settings.seed, l.frame, r.bytes);
    if (has_image(i) && !r.bytes_repeat(logged))
        differs.push_back(
            fmt::format("image_crc32: {:08x}, logged {:08x}", image_crc32(r.bytes), logged.image_crc32));
    return differs;
}

/// The embedded line is written just before the hand-over: whether the deadline was met then is not in the log
/// where it was missed after all.
bool Replay::Impl::bytes_repeat(const LoggedFrame& logged) {
    if (!camera.embedded_line) return image_crc32(bytes) == logged.image_crc32;
    FrameLedger line = logged.ledger;
    line.camera = index;
    line.t_hand_over_ns = 0;
    const std::size_t row = bytes.size() / static_cast<std::size_t>(camera.height);
    const auto same = [&](bool in_time) {
        line.deadline_met = in_time;
        (void)encode_embedded_line(line, std::span(bytes).last(row));  // World::create refuses rows too narrow
        return image_crc32(bytes) == logged.image_crc32;
    };
    return (!logged.ledger.deadline_met && same(false)) || same(true);
}

ReferenceComparison Replay::against(int spp) {
    Impl& r = *impl_;
    FrameSettings settings = r.settings_of(r.made);
    settings.budget = {};
    settings.spp = spp;
    settings.seed = ~settings.seed;
    const FrameAccount account =
        r.renderer.render(r.placements[r.made], r.T_world_camera(r.made), settings, r.reference, &r.middles);
    return {compare(r.picture, r.reference, r.middles.body, r.full_scale), std::max(0.0, account.standard_error)};
}

}  // namespace narpa
