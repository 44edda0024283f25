// narpa replay - renders the frames of a logged run again, bit for bit, and compares them with a reference of many
// samples.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "apps/cli.h"
#include "apps/device_options.h"
#include "emulator/log/mcap_log.h"
#include "emulator/replay/replay_report.h"
#include "emulator/threads.h"
#include "rehearsal/runner/rerun.h"

namespace narpa::cli {
namespace {

constexpr std::size_t kDifferencesShown = 10;
constexpr int kFramesCompared = 10;  ///< by default

struct ReplayOptions {
    std::string folder, camera, scene, picture;
    std::string dynamics, navigation;  ///< commands that replace ours in a lockstep rehearsal
    std::string mcap;
    int reference = 0, frames = 0, threads = 0;
};

struct Replayed {
    std::vector<ReplayedFrame> frames;
    std::size_t not_whole = 0;
    std::vector<ReplayedFrame> forged;  ///< not whole, and different from the log
    /// The frame that is farthest from its reference.
    std::size_t worst = 0;
    std::optional<RadianceImage> worst_picture, worst_reference;
};

/// Indices spread evenly over the run, including its first and last frame.
std::vector<std::size_t> chosen_frames(std::size_t frames, std::size_t wanted) {
    const std::size_t n = std::min(frames, wanted);
    std::vector<std::size_t> chosen;
    for (std::size_t k = 0; k < n; ++k) chosen.push_back(n > 1 ? k * (frames - 1) / (n - 1) : 0);
    return chosen;
}

std::vector<std::size_t> frames_for(const ReplayOptions& o, std::size_t logged) {
    if (o.frames > 0) return chosen_frames(logged, static_cast<std::size_t>(o.frames));
    return chosen_frames(logged, o.reference > 0 ? std::size_t{kFramesCompared} : logged);
}

/// The file of --mcap, made with the first camera that is replayed.
class McapOfReplay {
public:
    McapOfReplay(const std::string& path, const std::vector<std::string>& cameras)
        : path_(path), cameras_(cameras) {}

    /// Where the frames of this camera go; null: nowhere.
    Result<McapSource*> source_for(const Replay& run) {
        if (path_.empty()) return static_cast<McapSource*>(nullptr);
        const Scene& scene = run.world().scene();
        if (!log_) {
            std::vector<std::size_t> indices;
            for (std::size_t i = 0; i < scene.cameras.size(); ++i)
                if (i == run.camera_index() || std::ranges::count(cameras_, scene.cameras[i].name) > 0)
                    indices.push_back(i);
            auto log = McapLog::create(path_, scene, indices, {}, true);
            if (!log) return log.error();
            log_ = *std::move(log);
        }
        return &log_->source_of_camera(run.camera_index());
    }
    Status close() {
        if (!log_) return Ok{};
        Status closed = log_->close();
        if (closed) say("wrote " + path_);
        return closed;
    }

private:
    std::string path_;
    std::vector<std::string> cameras_;
    std::unique_ptr<McapLog> log_;
};

Replayed render_again(const ReplayOptions& o, Replay& run, McapSource* mcap) {
    TracingThreads threads(o.threads);
    Progress progress(fmt::format("rendering {} again", o.folder));
    const std::vector<std::size_t> chosen = frames_for(o, run.frames().size());
    Replayed done;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
        progress.show(static_cast<double>(k) / static_cast<double>(chosen.size()),
                      fmt::format("frame {} of {}", k + 1, chosen.size()));
        const std::size_t i = chosen[k];
        if (!run.has_image(i)) {
            ++done.not_whole;
            if (auto differs = run.make(i); !differs.empty())
                done.forged.push_back({run.frames()[i], std::move(differs), {}});
            continue;
        }
        ReplayedFrame frame{run.frames()[i], {}, {}};
        threads.arena.execute([&] {
            frame.differs = run.make(i);
            if (mcap) mcap->frame(frame.logged.ledger, run.bytes(), run.placement(i));
            if (o.reference > 0) frame.compared = run.against(o.reference);
        });
        done.frames.push_back(std::move(frame));
        if (!done.frames.back().compared) continue;
        const auto error = [&](std::size_t at) { return done.frames[at].compared->difference.rmse; };
        if (!done.worst_picture || error(done.frames.size() - 1) > error(done.worst)) {
            done.worst = done.frames.size() - 1;
            done.worst_picture = run.picture();
            done.worst_reference = run.reference();
        }
    }
    return done;
}

/// "nav.ledger.csv:12: frame 10: rays: 512, logged 513" for each, up to kDifferencesShown.
std::string differences_text(const Replayed& done, const std::string& log) {
    std::string out;
    std::size_t shown = 0, differing = 0;
    for (const auto* frames : {&done.frames, &done.forged})
        for (const ReplayedFrame& f : *frames) {
            if (f.differs.empty() || ++differing > kDifferencesShown) continue;
            out += fmt::format("{}:{}: frame {}: {}\n", log, f.logged.line, f.logged.ledger.frame,
                               fmt::join(f.differs, "; "));
            ++shown;
        }
    if (done.frames.empty())
        out += fmt::format("{}: no frame to repeat, expected one with an image at least\n", log);
    if (differing > shown) out += fmt::format("and {} frames more\n", differing - shown);
    if (differing > 0)
        out +=
            "expected the scene, its meshes and the program as they were in the run, and a processor of its kind\n";
    return out;
}

struct LoggedSensors {
    std::vector<std::string> cameras;
    bool lidars = false;
};

/// Sensors by the names of the log's files: NAME.ledger.csv, NAME.sweeps.csv.
LoggedSensors sensors_in(const std::string& folder) {
    constexpr std::string_view kLedger = ".ledger.csv";
    LoggedSensors found;
    std::error_code failed;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
        const std::string name = entry.path().filename().string();
        if (name.ends_with(kLedger)) found.cameras.push_back(name.substr(0, name.size() - kLedger.size()));
        found.lidars |= name.ends_with(".sweeps.csv");
    }
    std::sort(found.cameras.begin(), found.cameras.end());
    return found;
}

Outcome replay_camera(const ReplayOptions& o, McapOfReplay& mcap) {
    auto run = Replay::open(o.folder, o.camera, o.scene);
    if (!run) return run.error();
    const std::string& camera = (*run)->camera().name;
    const std::string log = o.folder + "/" + camera + ".ledger.csv";
    for (const std::string& file : (*run)->changed_files())
        say(fmt::format("warning: {} is not what it was in the run", file));
    if ((*run)->frames().empty()) return Error{fmt::format("holds no frame of camera \"{}\"", camera), log};

    const auto source = mcap.source_for(**run);
    if (!source) return source.error();
    const Replayed done = render_again(o, **run, *source);
    const auto repeated = static_cast<std::size_t>(
        std::count_if(done.frames.begin(), done.frames.end(), [](const auto& f) { return f.differs.empty(); }));
    const bool passed = repeated > 0 && repeated == done.frames.size() && done.forged.empty();
    say(fmt::format("{}: camera {}: {} of {} frames repeat bit for bit; {} in the log{}", o.folder, camera,
                    repeated, done.frames.size(), (*run)->frames().size(),
                    done.not_whole > 0 ? fmt::format("; {} had no whole image", done.not_whole) : ""));
    if (!passed) say(differences_text(done, log));

    nlohmann::json frames = nlohmann::json::array();
    for (const ReplayedFrame& f : done.forged) frames.push_back(to_json(f, (*run)->world().scene()));
    for (const ReplayedFrame& f : done.frames)
        if (f.compared || !f.differs.empty()) frames.push_back(to_json(f, (*run)->world().scene()));
    nlohmann::json document{{"passed", passed},
                            {"log", o.folder},
                            {"camera", camera},
                            {"changed_files", (*run)->changed_files()},
                            {"frames_logged", (*run)->frames().size()},
                            {"frames_replayed", done.frames.size()},
                            {"frames_not_whole", done.not_whole},
                            {"frames_repeated", repeated},
                            {"frames", frames}};
    if (o.reference == 0 || done.frames.empty()) return document;
    const BudgetCost cost = budget_cost(done.frames);
    say(to_text(done.frames, cost));
    document["reference_spp"] = o.reference;
    document["full_scale_w_m2_sr"] = done.frames.front().compared->difference.full_scale;
    document["cost"] = to_json(cost);
    if (!o.picture.empty()) {
        const std::string title = fmt::format("{}, camera {}: the frame farthest from {} samples per pixel",
                                              (*run)->world().scene().name, camera, o.reference);
        const auto written =
            plot_replay(o.picture, title, done.frames[done.worst], *done.worst_picture, *done.worst_reference);
        if (!written) return written.error();
        say("wrote " + o.picture);
    }
    return document;
}

/// Replays several cameras; `cameras` of the document has an entry for each.
Outcome replay_cameras(ReplayOptions o, const std::vector<std::string>& cameras) {
    McapOfReplay mcap(o.mcap, cameras);
    bool passed = true;
    nlohmann::json documents = nlohmann::json::array();
    for (const std::string& camera : cameras) {
        o.camera = camera;
        auto document = replay_camera(o, mcap);
        if (!document) return document;
        passed = passed && document->value("passed", false);
        documents.push_back(*std::move(document));
    }
    if (auto closed = mcap.close(); !closed) return closed.error();
    if (documents.size() == 1) return documents[0];
    return nlohmann::json{{"passed", passed}, {"log", o.folder}, {"cameras", documents}};
}

Outcome replay(const ReplayOptions& o) {
    if (!o.picture.empty() && o.reference == 0)
        return Error{
            fmt::format("-o {} shows frames beside their reference, expected --reference SPP too", o.picture)};
    for (const auto& make : {make_folder_of_picture(o.picture), make_folder_of(o.mcap)})
        if (!make) return make.error();
    const LoggedSensors logged = sensors_in(o.folder);
    if (logged.cameras.empty() && logged.lidars)
        return Error{"has no log of a camera, NAME.ledger.csv, expected one: sweeps of LiDARs are not replayed",
                     o.folder};
    const std::vector<std::string> cameras =
        o.camera.empty() && !logged.cameras.empty() ? logged.cameras : std::vector{o.camera};
    if (!o.picture.empty() && cameras.size() > 1)
        return Error{fmt::format("-o {} shows frames of one camera, expected --camera {} too", o.picture,
                                 fmt::join(cameras, " or "))};
    Outcome outcome = replay_cameras(o, cameras);
    if (outcome && logged.lidars) say(o.folder + ": sweeps are not compared");
    return outcome;
}

/// A rehearsal in lockstep is run again as a whole; of a run in real time only the emulator's frames can be
/// repeated.
Outcome replay_any(const ReplayOptions& o) {
    const bool commands = !o.dynamics.empty() || !o.navigation.empty();
    const auto only_frames = [&](std::string_view why) {
        return Error{fmt::format("{}: --dynamics and --navigation go with a rehearsal in lockstep as a whole", why),
                     o.folder};
    };
    std::error_code none;
    if (!std::filesystem::exists(o.folder + "/rehearsal.json", none)) {
        if (commands) return only_frames("is not the folder of a rehearsal");
        return replay(o);
    }
    const auto record = rehearsal::read_record(o.folder);
    if (!record) return record.error();
    const bool frames_alone = o.reference > 0 || o.frames > 0 || !o.camera.empty();
    if ((*record)["mode"] != "lockstep" || frames_alone) {
        if (commands) return only_frames("only its frames are replayed");
        ReplayOptions emulator = o;
        emulator.folder += "/emulator";
        return replay(emulator);
    }
    if (auto made = make_folder_of(o.mcap); !made) return made.error();
    stop_on_signals();
    Progress progress("running " + o.folder + " again");
    return rehearsal::rerun({o.folder, o.dynamics, o.navigation, o.threads, NARPA_VERSION, {}, o.mcap},
                            {say,
                             [&](double share, double left_s, std::string_view text) {
                                 progress.show({share, std::string(text), left_s});
                             }},
                            stop_flag());
}

}  // namespace

Command add_replay(Parser app) {
    auto o = std::make_shared<ReplayOptions>();
    const Parser c = app.subcommand(
        "replay",
        "Render the frames of a logged run again, bit for bit, and report the error that their budget left");
    c.option("DIR", o->folder, "Folder that `run --log` or `rehearse` has written").required();
    c.option("--camera", o->camera, "Name of the camera (default: each that is in the log)").type_name("NAME");
    c.option("--scene", o->scene, "Scene file (default: the run's)").type_name("SCENE");
    c.option("--reference", o->reference,
             "Compare with this number of samples per pixel: error, similarity, shifts of bodies and edges")
        .range(2, 65535);
    c.option("--frames", o->frames, "Number of frames, spread over the run (default: all; 10 with --reference)")
        .range(1, 1000000);
    c.option("--threads", o->threads, "Threads (default: all cores); the bytes do not depend on it").range(0, 1024);
    for (const auto& [name, command] : {std::pair{"dynamics", &o->dynamics}, {"navigation", &o->navigation}})
        c.option(fmt::format("--{}", name), *command,
                 fmt::format("Command in place of narpa-{}, where the rehearsal had one, as for `rehearse`. A "
                             "command in the log is never run",
                             name))
            .type_name("COMMAND");
    c.option("-o,--output", o->picture, "The worst frame, its reference, their difference").type_name("FILE.png");
    add_mcap_to(c, o->mcap);
    c.footer(
        "Exit status 1 if a frame does not repeat bit for bit, or none has an image. RMSE, bias and errors are of "
        "the mean of the bands, as fractions of the radiance at full scale.");
    c.group("Results");
    c.examples({"narpa replay out/first-flight",
                "narpa replay out/first-flight --reference 64 --frames 10 -o out/cost.png"});
    return [o] { return replay_any(*o); };
}

}  // namespace narpa::cli
