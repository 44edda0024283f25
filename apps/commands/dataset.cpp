// narpa dataset - labelled images of a scene's target, in shards.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>

#include "apps/cli.h"
#include "apps/scene_argument.h"
#include "apps/slurm.h"
#include "apps/warnings.h"
#include "base/shard.h"
#include "base/stop.h"
#include "base/text/nearest_name.h"
#include "dataset/folder/dataset_folder.h"
#include "dataset/gather/gather.h"
#include "dataset/image/image_maker.h"
#include "dataset/verify/verify.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

namespace ds = narpa::dataset;

constexpr int kImagesPerTask = 1000;  // on a cluster: they take longer than to start a task and read the scene

struct DatasetOptions {
    SceneArgument recipe;
    std::string out, shard = "1/1";
    std::optional<int> images, verify;
    bool gather = false, no_gather = false;
    int threads = 0;
    SlurmOptions slurm;
};

/// The recipe, or that of a scene alone.
Result<ds::Recipe> recipe_of(const SceneArgument& argument) {
    const auto file = find_file(FileKind::dataset, argument.file);
    if (file) return ds::read_recipe(*file, argument.sets);
    const auto scene = find_file(FileKind::scene, argument.file);
    if (scene) return ds::recipe_of_scene(*scene, argument.sets);
    if (find_file(FileKind::scenario, argument.file)) return file.error();  // says what it is
    std::vector<std::string> names;
    for (const FileKind kind : {FileKind::dataset, FileKind::scene})
        for (const ShippedFile& shipped : shipped_files(kind)) names.push_back(shipped.name);
    return Error{
        fmt::format("no such file, expected a recipe of a data set or a scene (TOML), or the name of one that "
                    "`narpa list` shows{}",
                    did_you_mean(argument.file, names)),
        argument.file};
}

Result<std::unique_ptr<ds::SceneSet>> load_scenes(const DatasetOptions& o) {
    const auto recipe = recipe_of(o.recipe);
    if (!recipe) return recipe.error();
    auto scenes = [&] {
        const Progress progress("reading " + recipe->scene);
        return ds::SceneSet::create(*recipe, o.threads);
    }();
    if (!scenes) return scenes;
    for (const std::string& w : (*scenes)->warnings()) warn(w);
    if (auto good = check_warnings(recipe->file); !good) return good.error();
    return scenes;
}

Error stopped(std::size_t left) {
    return {fmt::format("stopped, {} images of this shard are left: the same command makes them", left),
            {},
            0,
            0,
            ErrorKind::failed};
}

/// Makes or checks the folder.
Status open(const DatasetOptions& o, ds::SceneSet& scenes) {
    const ds::Recipe& recipe = scenes.recipe();
    return ds::open_dataset(
        o.out, {static_cast<std::uint32_t>(*o.images), recipe.outputs, recipe.text, scenes.fingerprint()});
}

/// Makes the images that the shard lacks.
Outcome make(const DatasetOptions& o, const Shard& shard, ds::SceneSet& scenes) {
    if (auto opened = open(o, scenes); !opened) return opened.error();
    ds::remove_leftovers(o.out, shard);
    const auto plan = ds::plan_shard(o.out, shard);
    if (!plan) return plan.error();
    const std::size_t total = plan->missing.size();
    std::atomic<std::size_t> done{0};
    const auto start = std::chrono::steady_clock::now();
    Status made = Ok{};
    if (total > 0) {
        const Progress progress("making images", [&] {
            return Step{static_cast<double>(done) / static_cast<double>(total),
                        fmt::format("{} of {}", done.load(), total)};
        });
        made = ds::make_images(scenes, o.out, plan->missing, {o.threads, &done, &stop_flag()});
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!made) return made.error();
    if (done < total) return stopped(total - done);
    say(fmt::format("{}: made {} of the {} images of shard {} in {:.1f} s; the others were there", o.out, total,
                    plan->images, shard.text(), seconds));
    return nlohmann::json{{"images", plan->images}, {"made", total}, {"seconds", seconds}};
}

/// Gathers a complete data set; one that is not is an Error only if that was asked for.
Result<bool> gather_if_complete(const DatasetOptions& o) {
    const auto plan = ds::plan_shard(o.out, {});
    if (!plan) return plan.error();
    if (!plan->missing.empty() && !o.gather) {
        say(fmt::format("{}: {} images of other shards are missing; the last shard gathers the labels", o.out,
                        plan->missing.size()));
        return false;
    }
    std::vector<std::string> warnings;
    {
        const Progress progress("gathering labels");
        if (auto gathered = ds::gather(o.out, warnings); !gathered) return gathered.error();
    }
    for (const std::string& w : warnings) warn(w);
    say(fmt::format("{}: gathered {} labels: coco.json, train.json, statistics.json, contact_sheet.png ...", o.out,
                    plan->images));
    return true;
}

Outcome verify(const DatasetOptions& o, ds::SceneSet& scenes) {
    const auto manifest = ds::read_manifest(o.out);
    if (!manifest) return manifest.error();
    if (manifest->recipe != scenes.recipe().text || manifest->scene_fingerprint != scenes.fingerprint())
        return Error{"is of another recipe or of other scene files, expected those that it was made of", o.out};
    const auto sample = ds::sampled_images(manifest->images, static_cast<std::uint32_t>(*o.verify));
    nlohmann::json rows = nlohmann::json::array();
    std::size_t failed = 0;
    ds::VerifiedImage worst;
    std::atomic<std::size_t> done{0};
    const Progress progress("verifying labels", [&] {
        return Step{static_cast<double>(done) / static_cast<double>(sample.size()), {}};
    });
    for (const std::uint32_t image : sample) {
        const auto v = ds::verify_image(scenes, o.out, image);
        if (!v) return v.error();
        ++done;
        rows.push_back(ds::to_json(*v));
        worst.silhouette = std::max(worst.silhouette, v->silhouette);
        worst.keypoint_px = std::max(worst.keypoint_px, v->keypoint_px);
        if (v->passed) continue;
        ++failed;
        say(fmt::format(
            "image {}: its label does not describe it: {:.3g} of the silhouettes differ, keypoints by up "
            "to {:.3g} px, {} of them in their state, the Sun by {:.3g} rad, {:.3g} of the samples",
            image, v->silhouette, v->keypoint_px, v->keypoints_wrong, v->sun_rad, v->image_levels));
    }
    say(fmt::format("verified {} of {} images: {} disagree; at most {:.2g} of the silhouettes and {:.2g} px",
                    sample.size(), manifest->images, failed, worst.silhouette, worst.keypoint_px));
    return nlohmann::json{{"verified", rows}, {"passed", failed == 0}};
}

/// The command line of a part on the cluster, without --shard.
std::vector<std::string> arguments(const DatasetOptions& o) {
    std::vector<std::string> a{"dataset", o.recipe.file, "-o", o.out};
    for (const std::string& set : o.recipe.sets) a.insert(a.end(), {"--set", set});
    return a;
}

/// Submits the images that are missing.
Outcome make_on_cluster(const DatasetOptions& o, ds::SceneSet& scenes) {
    if (auto opened = open(o, scenes); !opened) return opened.error();
    if (auto good = check_not_queued(o.out); !good) return good.error();
    const auto plan = ds::plan_shard(o.out, {});
    if (!plan) return plan.error();
    if (plan->missing.empty()) {
        const auto gathered = gather_if_complete(o);
        if (!gathered) return gathered.error();
        return nlohmann::json{{"images", plan->images}, {"made", 0}, {"gathered", true}};
    }
    const int jobs_most = o.slurm.max_jobs.value_or(std::clamp(*o.images / kImagesPerTask, 1, 1000));
    SlurmWork work{o.out,
                   scenes.recipe().name,
                   arguments(o),
                   o.threads == 0,
                   arguments(o),
                   plan->missing,
                   static_cast<std::uint32_t>(std::min(jobs_most, *o.images))};
    work.part.insert(work.part.end(), {"-n", std::to_string(*o.images), "--no-gather"});
    if (o.threads > 0) work.part.insert(work.part.end(), {"--threads", std::to_string(o.threads)});
    work.gather.emplace_back("--gather");
    const auto jobs = submit_to_slurm(o.slurm, work);
    if (!jobs) return jobs.error();
    say(submitted_text(*jobs, fmt::format("{} images", work.missing.size()), o.out));
    if (!o.slurm.wait) return to_json(*jobs);
    const auto status = wait_for_slurm(*jobs, o.out);
    if (!status) return status.error();
    const auto after = ds::plan_shard(o.out, {});
    if (!after) return after.error();
    if (*status != 0)
        return Error{fmt::format("{} images are missing, and the job that gathers ended with status {}: its output "
                                 "and that of the tasks is in slurm/*.log; the same command makes what is missing",
                                 after->missing.size(), *status),
                     o.out, 0, 0, ErrorKind::failed};
    say(fmt::format("{}: made {} images", o.out, work.missing.size()));
    return nlohmann::json{{"images", after->images}, {"made", work.missing.size()}, {"gathered", true}};
}

Outcome dataset(const DatasetOptions& o) {
    if (!o.images && !o.gather && !o.verify)
        return Error{"nothing to do: expected -n N to make images, --gather or --verify N"};
    const auto shard = shard_from(o.shard);
    if (!shard) return shard.error();
    if (!o.slurm.on.empty())
        if (auto good = o.slurm.check(); !good) return good.error();
    stop_on_signals();
    nlohmann::json document{{"folder", o.out}};
    std::unique_ptr<ds::SceneSet> scenes;
    if (o.images || o.verify) {
        auto loaded = load_scenes(o);
        if (!loaded) return loaded.error();
        scenes = *std::move(loaded);
    }
    if (o.images) {
        const Outcome made = o.slurm.on.empty() ? make(o, *shard, *scenes) : make_on_cluster(o, *scenes);
        if (!made) return made;
        document.update(*made);
    }
    if (o.slurm.on.empty() && !o.no_gather && (o.images || o.gather)) {
        const auto gathered = gather_if_complete(o);
        if (!gathered) return gathered.error();
        document["gathered"] = *gathered;
    }
    if (o.verify) {
        const Outcome verified = verify(o, *scenes);
        if (!verified) return verified;
        document.update(*verified);
    }
    return document;
}

}  // namespace

Command add_dataset(Parser app) {
    auto o = std::make_shared<DatasetOptions>();
    const Parser c = app.subcommand(
        "dataset", "Make labelled images of a scene's target for learned navigation: pose, mask, depth, keypoints");
    c.option(
         "RECIPE", o->recipe.file,
         "Recipe or scene file (TOML), or a name that `narpa list` shows; a scene alone is drawn with the defaults "
         "of a recipe")
        .required();
    o->recipe.add_settings_to(c);
    const Option images =
        c.option("-n,--images", o->images,
                 "Number of images of the whole data set. Image i is the same in data sets of any size")
            .range(1, 100'000'000);
    c.option("-o,--output", o->out, "Folder of the data set").type_name("DIR").required();
    const Option shard = c.option("--shard", o->shard,
                                  "Make the K-th of M parts: images whose number i has i mod M = K - 1. Shards may "
                                  "run at once, on machines "
                                  "that share the folder; the last one gathers the labels")
                             .type_name("K/M");
    const Option gather = c.flag(
        "--gather", o->gather,
        "Write coco.json, train.json, statistics.json ... from the labels; an error where images are missing. "
        "Without -n makes no image");
    const Option no_gather =
        c.flag("--no-gather", o->no_gather, "Never write them: a command with --gather follows").excludes(gather);
    const Option verify =
        c.option(
             "--verify", o->verify,
             "Render N images again at the poses of their labels and compare; exit status 1 where one disagrees")
            .range(1, 100'000'000);
    o->slurm.add_to(c, "one for 1000 images, up to 1000")
        .needs(images)
        .excludes(shard)
        .excludes(gather)
        .excludes(no_gather)
        .excludes(verify);
    c.option("--threads", o->threads, "Threads (default: all cores); the bytes do not depend on it").range(0, 1024);
    c.group("Sensors");
    c.footer("What is there already is not made again: after an interruption, the same command continues.");
    c.examples({"narpa dataset docking-dataset -n 1000 -o out/docking",
                "narpa dataset docking -n 100 -o out/quick --set camera.nav.resolution=[256,256]",
                "narpa dataset docking-dataset -n 100000 -o /shared/docking --shard 3/16",
                "narpa dataset docking-dataset -n 100000 -o /shared/docking --on slurm:PARTITION --wait",
                "narpa dataset docking-dataset -o out/docking --verify 50"});
    return [o] { return dataset(*o); };
}

}  // namespace narpa::cli
