#include "emulator/replay/replay.h"

#include <fmt/format.h>

#include <algorithm>

#include "emulator/camera/camera_control.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/log/run_record.h"
#include "protocols/video/embedded_line.h"
#include "renderer/camera/read_out.h"
#include "renderer/detector/detector.h"

namespace narpa {
namespace {

/// The motions of all bodies at one time of the log, in the order of the scene's bodies.
class LoggedMotions {
public:
    LoggedMotions(std::vector<TrajectoryRow> rows, const World& world, std::string file)
        : rows_(std::move(rows)), world_(world), file_(std::move(file)) {
        std::stable_sort(rows_.begin(), rows_.end(), by_time);
    }

    Result<std::vector<Motion>> at(std::int64_t t_ns, const LoggedFrame& frame,
                                   const std::string& ledger_file) const {
        const std::size_t bodies = world_.scene().bodies.size();
        const auto [begin, end] =
            std::equal_range(rows_.begin(), rows_.end(), TrajectoryRow{t_ns, {}, {}, 0}, by_time);
        std::vector<Motion> motions(bodies);
        for (auto row = begin; row != end; ++row) {
            const auto body = world_.body_named(row->body);
            if (!body)
                return Error{fmt::format("body \"{}\" at {:.9f} s, which the scene \"{}\" does not have", row->body,
                                         static_cast<double>(t_ns) * 1e-9, world_.scene().file),
                             file_, row->line};
            motions[*body] = row->motion;
        }
        if (static_cast<std::size_t>(end - begin) != bodies)
            return Error{fmt::format("frame {} at {} ns: {} holds {} poses for this time, expected {}",
                                     frame.ledger.frame, t_ns, file_, end - begin, bodies),
                         ledger_file, frame.line, 1};
        return motions;
    }

private:
    static bool by_time(const TrajectoryRow& a, const TrajectoryRow& b) { return a.t_ns < b.t_ns; }
    std::vector<TrajectoryRow> rows_;
    const World& world_;
    std::string file_;
};

/// Poses of the bodies and the camera in each frame, in the frames' order.
struct LoggedPlacements {
    std::vector<BodyPoses> bodies;
    std::vector<CameraPose> cameras;
};
Result<LoggedPlacements> placements_of(const std::vector<LoggedFrame>& frames, const World& world,
                                       const Camera& camera, const std::string& ledger_file,
                                       const std::string& truth_file) {
    auto rows = read_trajectory(truth_file);
    if (!rows) return rows.error();
    const LoggedMotions logged(*std::move(rows), world, truth_file);
    const std::size_t bodies = world.scene().bodies.size();
    LoggedPlacements placements;
    placements.bodies.reserve(frames.size());
    placements.cameras.reserve(frames.size());
    for (const LoggedFrame& frame : frames) {
        const FrameLedger& l = frame.ledger;
        const auto middle = logged.at(l.t_exposure_mid_ns, frame, ledger_file);
        if (!middle) return middle.error();
        const auto start = camera.shutter ? logged.at(l.t_exposure_start_ns, frame, ledger_file) : middle;
        if (!start) return start.error();
        const auto end = camera.shutter ? logged.at(l.t_exposure_end_ns, frame, ledger_file) : middle;
        if (!end) return end.error();
        BodyPoses& at = placements.bodies.emplace_back(bodies);
        for (std::size_t i = 0; i < bodies; ++i) at.set(i, (*start)[i].T_world_body, (*end)[i].T_world_body);
        placements.cameras.push_back(
            camera_pose(world, camera, at, l.t_exposure_start_ns, l.t_exposure_end_ns, *middle));
    }
    return placements;
}

/// Checks that an operated camera can have had the settings that each frame states.
Status check_settings(const std::vector<LoggedFrame>& frames, const Camera& camera,
                      const std::string& ledger_file) {
    if (!camera.control) return Ok{};
    for (const LoggedFrame& f : frames) {
        const FrameLedger& l = f.ledger;
        if (l.region_width == 0 || l.region_height == 0 || l.region_x + l.region_width > camera.width ||
            l.region_y + l.region_height > camera.height)
            return Error{
                fmt::format("frame {}: a region of {} x {} at ({}, {}), expected one within {} x {}", l.frame,
                            l.region_width, l.region_height, l.region_x, l.region_y, camera.width, camera.height),
                ledger_file, f.line, 1};
        if (l.t_exposure_end_ns - l.t_exposure_start_ns <= rows_ns(camera))
            return Error{fmt::format("frame {}: its exposure takes no time", l.frame), ledger_file, f.line, 1};
    }
    return Ok{};
}

/// "rays: 512, logged 513", where they are not the same.
template <class Value>
void expect_same(std::string_view what, const Value& now, const Value& logged, std::vector<std::string>& differs) {
    if (now != logged) differs.push_back(fmt::format("{}: {}, logged {}", what, now, logged));
}

}  // namespace

Replay::Replay(std::unique_ptr<World> world, std::size_t camera_index)
    : world_(std::move(world)),
      camera_(world_->scene().cameras[camera_index]),
      index_(static_cast<std::uint8_t>(camera_index)),
      settings_(narpa::settings_of(camera_)),
      full_scale_(full_scale_radiance(camera_)),
      renderer_(world_->render_scene(), camera_),
      sensor_array_(SensorArray::create(camera_, world_->scene().render.seed)),
      picture_(camera_.width, camera_.height),
      reference_(camera_.width, camera_.height),
      bytes_(frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns})) {}

Result<std::unique_ptr<Replay>> Replay::open(const std::string& folder, const std::string& camera,
                                             const std::string& scene_file) {
    const auto record = read_run_record(folder);
    if (!record) return record.error();
    auto scene = read_run_scene(*record, scene_file);
    if (!scene) return scene.error();
    const auto index = sensor_named(scene->cameras, camera, "camera", scene->file);
    if (!index) return index.error();
    const std::string stem = folder + "/" + scene->cameras[*index].name;
    auto frames = read_ledger_log(stem + ".ledger.csv");
    if (!frames) return frames.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    const Camera& as_in_the_scene = (*world)->scene().cameras[*index];
    if (auto good = check_settings(*frames, as_in_the_scene, stem + ".ledger.csv"); !good) return good.error();
    auto placements = placements_of(*frames, **world, as_in_the_scene, stem + ".ledger.csv", stem + ".truth.csv");
    if (!placements) return placements.error();
    std::unique_ptr<Replay> replay(new Replay(*std::move(world), *index));
    replay->frames_ = *std::move(frames);
    if (scene_file.empty()) replay->changed_files_ = narpa::changed_files(*record);
    replay->placements_ = std::move(placements->bodies);
    replay->poses_ = std::move(placements->cameras);
    return replay;
}

FrameSettings Replay::settings_of(std::size_t i) const {
    const FrameLedger& logged = frames_[i].ledger;
    const RenderSettings& render = world_->scene().render;
    FrameSettings s;
    s.seed = seed_of_camera(render.seed, index_);
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

/// The camera as it was set for the frame.
void Replay::set(const FrameLedger& l) {
    if (!camera_.control) return;
    const Camera& as_in_the_scene = world_->scene().cameras[index_];
    settings_ = narpa::settings_of(l, as_in_the_scene);
    apply(settings_, as_in_the_scene, camera_);
    full_scale_ = full_scale_radiance(camera_);
}

std::vector<std::string> Replay::make(std::size_t i) {
    const LoggedFrame& logged = frames_[i];
    set(logged.ledger);
    const FrameSettings settings = settings_of(i);
    const FrameAccount account = renderer_.render(placements_[i], poses_[i], settings, picture_);
    made_ = i;

    std::vector<std::string> differs;
    const FrameLedger& l = logged.ledger;
    expect_same("step", kStepNames[static_cast<std::size_t>(account.step)], kStepNames[l.step], differs);
    expect_same("samples", account.samples, l.samples, differs);
    expect_same("rays", account.rays, l.rays, differs);
    if (!has_image(i) && l.passes[0] > 0) differs.push_back(fmt::format("passes: none, logged {}", l.passes[0]));
    // A frame that had no time left to estimate its error (-1) has time here.
    const bool no_time_left = l.budget_kind == BudgetKind::time && l.expected_error == -1;
    const double error = account.standard_error >= 0 ? account.standard_error / full_scale_ : -1;
    if (!no_time_left) expect_same("expected_error", static_cast<float>(error), l.expected_error, differs);
    expose(camera_, picture_, settings.seed, l.frame, bytes_, sensor_array_.get());
    if (camera_.control)
        read_out({camera_.width, camera_.height, camera_.format, camera_.period_ns}, settings_.region,
                 settings_.binning, bytes_);
    if (has_image(i) && !bytes_repeat(logged))
        differs.push_back(
            fmt::format("image_crc32: {:08x}, logged {:08x}", image_crc32(bytes_), logged.image_crc32));
    return differs;
}

/// The embedded line is written just before the hand-over. Where the log says that the deadline was missed, it may
/// have passed in between, so both values of the flag in the line are tried.
bool Replay::bytes_repeat(const LoggedFrame& logged) {
    if (!camera_.embedded_line) return image_crc32(bytes_) == logged.image_crc32;
    FrameLedger line = logged.ledger;
    line.camera = index_;
    line.t_hand_over_ns = 0;
    const std::size_t row = bytes_.size() / static_cast<std::size_t>(camera_.height);
    const auto same = [&](bool in_time) {
        line.deadline_met = in_time;
        (void)encode_embedded_line(line, std::span(bytes_).last(row));  // World::create refuses rows too narrow
        return image_crc32(bytes_) == logged.image_crc32;
    };
    return (!logged.ledger.deadline_met && same(false)) || same(true);
}

ReferenceComparison Replay::against(int spp) {
    Aovs aovs;
    FrameSettings settings = settings_of(made_);
    settings.budget = {};
    settings.spp = spp;
    settings.seed = ~settings.seed;
    const FrameAccount account = renderer_.render(placements_[made_], poses_[made_], settings, reference_, &aovs);
    return {compare(picture_, reference_, aovs.body, full_scale_), std::max(0.0, account.standard_error)};
}

}  // namespace narpa
