#include "apps/commands/estimate_stereo.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "apps/commands/remade.h"
#include "apps/outputs.h"
#include "apps/warnings.h"
#include "emulator/log/run_record.h"
#include "emulator/threads.h"
#include "renderer/camera/scene_camera.h"
#include "tracking/stereo_tracker.h"

namespace narpa::cli {
namespace {

/// LEFT and RIGHT.
Result<std::pair<std::string, std::string>> names_of(const std::string& cameras) {
    const auto comma = cameras.find(',');
    std::pair names{cameras.substr(0, comma), comma == std::string::npos ? "" : cameras.substr(comma + 1)};
    if (names.first.empty() || names.second.empty() || names.second.find(',') != std::string::npos)
        return Error{fmt::format("--stereo {}: expected the names of two cameras, LEFT,RIGHT", cameras)};
    return names;
}

/// Opens the log of a camera. Errors: those of Replay::open; a run that has no frames of it.
Result<std::unique_ptr<Replay>> open_camera(const RunEstimate& o, const std::string& camera) {
    auto run = Replay::open(o.folder, camera, o.scene);
    const std::string ledger = o.folder + "/" + camera + ".ledger.csv";
    std::error_code unknown;
    const bool is_missing = !run && run.error().file == ledger && !std::filesystem::exists(ledger, unknown);
    if (is_missing || (run && (*run)->frames().empty()))
        return Error{
            fmt::format("holds no frames of camera \"{}\", expected a run with --video {}=SINK", camera, camera),
            o.folder};
    return run;
}

/// The frame of `right` that was exposed with this one of `left`.
std::optional<std::size_t> partner_of(const FrameLedger& left, const Replay& right) {
    for (std::size_t i = 0; i < right.frames().size(); ++i) {
        const FrameLedger& r = right.frames()[i].ledger;
        if (std::abs(r.t_exposure_mid_ns - left.t_exposure_mid_ns) <= kSimultaneous_ns && right.has_image(i) &&
            r.delivery == Delivery::frame)
            return i;
    }
    return {};
}

Error never_together(const Replay& left, const Replay& right, const std::string& folder) {
    const auto times = [](const Replay& run) {
        std::string text;
        for (std::size_t i = 0; i < std::min<std::size_t>(3, run.frames().size()); ++i)
            text += fmt::format("{}{:.6f}", i == 0 ? "" : ", ",
                                1e-9 * static_cast<double>(run.frames()[i].ledger.t_exposure_mid_ns));
        return text;
    };
    return Error{
        fmt::format("cameras \"{}\" and \"{}\" never exposed at the same time: mid-exposures at {} ... and {} "
                    "... s, expected the same rate_hz and exposure_s",
                    left.camera().name, right.camera().name, times(left), times(right)),
        folder};
}

}  // namespace

void StereoFlags::add_to(Parser app) {
    app.option("--stereo", cameras,
               "Two cameras on one body that expose at the same time: poses from pairs of frames")
        .type_name("LEFT,RIGHT");
    app.option(
           "--depth-map", files.maps,
           "With --stereo: depth along LEFT's axis for each of its pixels, as floats (FILE.pfm) or as a picture; "
           "can be repeated. Of a run, with the frame's number in the name")
        .type_name("FILE")
        .repeatable();
    app.option("--cloud", files.clouds,
               "With --stereo: the points of the depth map with their standard deviations: FILE.ply, .pcd, or .csv "
               "with "
               "covariances")
        .type_name("FILE")
        .repeatable();
    app.option("--grid", files.grid_px, "With --depth-map, --cloud: match every N-th pixel of every N-th row")
        .range(1, 64)
        .shows_default();
}

Outcome estimate_stereo_run(const RunEstimate& o, const StereoFlags& flags, const TrackerOptions& options) {
    const auto names = names_of(flags.cameras);
    if (!names) return names.error();
    if (auto made = make_folder_of(o.csv); !made) return made.error();
    if (auto made = make_folder_of_picture(o.picture); !made) return made.error();
    if (auto made = flags.files.prepare(); !made) return made.error();
    auto left = open_camera(o, names->first);
    if (!left) return left.error();
    auto right = open_camera(o, names->second);
    if (!right) return right.error();
    const World& world = (*left)->world();
    const auto tracker = StereoTracker::create(world, (*left)->camera_index(), (*right)->camera_index(), options);
    if (!tracker) return tracker.error();

    std::vector<TrackedFrame> tracked;
    std::size_t alone = 0;
    nlohmann::json maps = nlohmann::json::array();
    const Status made = each_frame(o, **left, [&](std::size_t i) -> Status {
        const LoggedFrame& l = (*left)->frames()[i];
        const auto j = partner_of(l.ledger, **right);
        if (!j) return ++alone, Ok{};
        if (auto again = make_again(o, **right, *j); !again) return again;
        const FrameLedger& r = (*right)->frames()[*j].ledger;
        const BodyPoses& at = (*left)->placement(i);
        tracked.push_back((*tracker)->take({l.ledger, (*left)->bytes()}, {r, (*right)->bytes()}, at));
        if (!flags.files.any() || !(*tracker)->images()) return Ok{};
        auto written = write_stereo_files(
            flags.files, {world, *(*tracker)->images(), tracked.back(), (*tracker)->target(), at}, l.ledger.frame);
        if (!written) return written.error();
        maps.push_back(*std::move(written));
        return Ok{};
    });
    if (!made) return made.error();
    if (tracked.empty()) return never_together(**left, **right, o.folder);
    if (alone > 0)
        warn(fmt::format("{} frames of camera \"{}\" have no frame of \"{}\" of the same time", alone, names->first,
                         names->second));
    Outcome report = report_run(o,
                                {"cameras", flags.cameras, world.scene().bodies[(*tracker)->target()].name,
                                 "stereo", world.scene().name, "pair"},
                                tracked);
    if (report && !maps.empty()) (*report)["depth_maps"] = std::move(maps);
    return report;
}

Outcome estimate_stereo_frames(const FileEstimate& file, const StereoFlags& flags, TrackerOptions options) {
    const auto names = names_of(flags.cameras);
    if (!names) return names.error();
    if (file.frames.size() != 2)
        return Error{fmt::format("--stereo with {} --frame: expected two, of \"{}\" and of \"{}\"",
                                 file.frames.size(), names->first, names->second)};
    for (const auto& outputs : {flags.files.maps, flags.files.clouds})
        if (auto kept = keep_inputs(outputs, file.frames); !kept) return kept.error();
    if (auto made = flags.files.prepare(); !made) return made.error();
    const std::int64_t t_ns = std::llround(file.time_s * 1e9);
    auto world = world_of(file, t_ns, t_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto left = sensor_named(scene.cameras, names->first, "camera", scene.file);
    if (!left) return left.error();
    const auto right = sensor_named(scene.cameras, names->second, "camera", scene.file);
    if (!right) return right.error();
    const Camera& camera = scene.cameras[*left];
    const auto target = target_of(**world, camera.mount, camera.name, options.target);
    if (!target) return target.error();
    const auto left_bytes = frame_of(file.frames[0], camera);
    if (!left_bytes) return left_bytes.error();
    const auto right_bytes = frame_of(file.frames[1], scene.cameras[*right]);
    if (!right_bytes) return right_bytes.error();
    BodyPoses at(scene.bodies.size());
    (*world)->place(t_ns, camera.mount, at);
    const Rigid3 T_world_left = (*world)->camera_pose(camera, file.time_s, at);
    if (file.no_truth) options.guess = inverse(T_world_left) * at.T_world_body[*target];
    const auto tracker = StereoTracker::create(**world, *left, *right, options);
    if (!tracker) return tracker.error();
    const FrameLedger left_ledger = nominal_ledger(camera, t_ns);
    const FrameLedger right_ledger = nominal_ledger(scene.cameras[*right], t_ns);
    TracingThreads threads(file.threads);
    TrackedFrame tracked;
    Result<nlohmann::json> maps = nlohmann::json();
    {
        const Progress progress("estimating the pose in " + file.frames[0] + " and " + file.frames[1]);
        threads.arena.execute([&] {
            tracked = (*tracker)->take({left_ledger, *left_bytes}, {right_ledger, *right_bytes}, at);
        });
    }
    if (flags.files.any() && (*tracker)->images())
        threads.arena.execute([&] {
            maps = write_stereo_files(flags.files,
                                      {**world, *(*tracker)->images(), tracked, *target, at, !file.no_truth});
        });
    if (!maps) return maps.error();
    nlohmann::json document = tracked.measured
                                  ? show({scene.bodies[*target].name, flags.cameras, "cameras", T_world_left,
                                          options.guess.value_or(tracked.truth), file.no_truth},
                                         *tracked.measured, tracked.covariance, tracked.bound, tracked.answer)
                                  : no_pose(file.frames[0] + " and " + file.frames[1], tracked.answer, tracked.why);
    document["matches"] = tracked.matches;
    if (!maps->is_null()) document["depth_maps"] = nlohmann::json::array({*maps});
    return document;
}

}  // namespace narpa::cli
